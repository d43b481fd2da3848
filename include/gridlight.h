/*
 * Gridlight from C: render tasks of a scene into your own memory, or be a worker of a master.
 * docs/c-abi.md is the tutorial.
 *
 * - Functions are named gridlight_TYPE_VERB and take the object, then inputs, then outputs.
 * - All types are opaque. What _new and _load give is yours until you _free it; _free(NULL) does nothing.
 * - Every function that can fail returns a gridlight_result. Outputs are written on success only.
 *   gridlight_error_text says, for people, why the last call of this thread failed.
 * - Pointers may not be NULL unless a function says so; NULL gives GRIDLIGHT_RESULT_NULL_PARAMETER.
 * - Strings are UTF-8 and end with NUL. Arrays that you pass come after the number of elements that
 *   they have room for.
 * - A const object may be used by several threads at once, any other by one at a time.
 *
 * Made by cbindgen from capi/src: do not edit.
 */

#ifndef GRIDLIGHT_H
#define GRIDLIGHT_H

#include <stdint.h>
#include <stddef.h>

/**
 * What a call came to. A number, once given, never means anything else.
 */
enum gridlight_result
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * It did what it says, and wrote its outputs.
     */
    GRIDLIGHT_RESULT_OK = 0,
    /**
     * A pointer is NULL that must not be.
     */
    GRIDLIGHT_RESULT_NULL_PARAMETER = 1,
    /**
     * A number or a string makes no sense.
     */
    GRIDLIGHT_RESULT_INVALID_PARAMETER = 2,
    /**
     * The memory for an output is too small.
     */
    GRIDLIGHT_RESULT_TOO_LITTLE_ROOM = 3,
    /**
     * The scene cannot be read, or Embree refuses it.
     */
    GRIDLIGHT_RESULT_SCENE = 4,
    /**
     * No frame can have these settings.
     */
    GRIDLIGHT_RESULT_SETTINGS = 5,
    /**
     * The frame has no such task.
     */
    GRIDLIGHT_RESULT_TASK = 6,
    /**
     * The worker was started, or stopped, before.
     */
    GRIDLIGHT_RESULT_WORKER_STARTED = 7,
    /**
     * The worker cannot work.
     */
    GRIDLIGHT_RESULT_WORKER = 8,
    /**
     * A fault of this library. Objects that the call was given may be freed, no more.
     */
    GRIDLIGHT_RESULT_PANIC = 9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum gridlight_result gridlight_result;
#else
typedef int32_t gridlight_result;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * A part of the light that is computed apart from the others.
 */
enum gridlight_component
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Light that comes straight from the emitters: one pass. 3 numbers for each pixel: R, G, B.
     */
    GRIDLIGHT_COMPONENT_DIRECT = 0,
    /**
     * Diffuse light from one set of virtual point lights. 3 numbers for each pixel: R, G, B.
     */
    GRIDLIGHT_COMPONENT_INDIRECT = 1,
    /**
     * Both at once, of all passes and sets, for GRIDLIGHT_ALGORITHM_STRAIGHTFORWARD. 6 numbers for each
     * pixel: direct R, G, B, then indirect.
     */
    GRIDLIGHT_COMPONENT_FULL = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum gridlight_component gridlight_component;
#else
typedef uint32_t gridlight_component;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How the work is divided into tasks.
 */
enum gridlight_algorithm
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Direct and indirect light are tasks of their own.
     */
    GRIDLIGHT_ALGORITHM_COMPONENT = 0,
    /**
     * A task is all light of its pixels.
     */
    GRIDLIGHT_ALGORITHM_STRAIGHTFORWARD = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum gridlight_algorithm gridlight_algorithm;
#else
typedef uint32_t gridlight_algorithm;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How a pass of direct light chooses its points on the emitters.
 */
enum gridlight_light_points
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The same point for every pixel.
     */
    GRIDLIGHT_LIGHT_POINTS_PER_PASS = 0,
    /**
     * Another point for each pixel.
     */
    GRIDLIGHT_LIGHT_POINTS_PER_PIXEL = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum gridlight_light_points gridlight_light_points;
#else
typedef uint32_t gridlight_light_points;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * A frame: a scene, settings, and the virtual point lights that belong to both.
 */
typedef struct gridlight_frame gridlight_frame;

/**
 * What each pixel sees first, row after row from the top.
 */
typedef struct gridlight_gbuffer gridlight_gbuffer;

/**
 * A scene in memory, with all that is needed to trace rays in it.
 */
typedef struct gridlight_scene gridlight_scene;

/**
 * The workload of a frame. Equal settings and scenes give equal light, bit for bit.
 */
typedef struct gridlight_settings gridlight_settings;

/**
 * One task of a frame: a component of the light for one group of pixels.
 */
typedef struct gridlight_task gridlight_task;

/**
 * A worker: renders for a master in threads of this process, until it is stopped.
 */
typedef struct gridlight_worker gridlight_worker;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Why the last call of this thread that failed did so, as a sentence for people: what, where, and what
 * to do. Empty if none has failed. Lives until the next call of this thread fails, or the thread ends.
 */
const char *gridlight_error_text(void);

/**
 * The version of this library and the revision it was built from, as `0.1.0 (1234abcd)`. Lives for ever.
 */
const char *gridlight_version(void);

/**
 * Loads a scene and builds its BVH, on all cores: a `.toml` file as docs/scene-format.md has it, or a
 * bare `.obj`, for which a camera and a light are chosen.
 *
 * @param path The file.
 * @param scene_out Receives the scene; free it by gridlight_scene_free.
 * @return GRIDLIGHT_RESULT_SCENE if the file, or one that it names, cannot be used.
 */
gridlight_result gridlight_scene_load(const char *path,
                                      gridlight_scene **scene_out);

/**
 * Frees a scene. Frames that were made of it stay usable.
 *
 * @param scene May be NULL.
 */
void gridlight_scene_free(gridlight_scene *scene);

/**
 * The picture's size that the scene file asks for, in pixels.
 *
 * @param scene The scene.
 * @param width_out Receives pixels per row.
 * @param height_out Receives rows.
 */
gridlight_result gridlight_scene_get_size(const gridlight_scene *scene,
                                          uint32_t *width_out,
                                          uint32_t *height_out);

/**
 * What people should know of a scene that was loaded all the same: a texture that is missing, say.
 *
 * @param scene The scene.
 * @param index Which note, from 0.
 * @return The note, which lives as long as the scene; NULL if there are no so many, or `scene` is NULL.
 */
const char *gridlight_scene_note(const gridlight_scene *scene,
                                 size_t index);

/**
 * Makes settings with the defaults of `master --paper` for the scene's own picture size: component by
 * component, 64 groups, 16 passes of direct light, 256 VPLs in 16 sets, an unbounded geometry term.
 *
 * @param scene The scene; only its size is taken.
 * @param settings_out Receives the settings; free them by gridlight_settings_free.
 */
gridlight_result gridlight_settings_new(const gridlight_scene *scene,
                                        gridlight_settings **settings_out);

/**
 * Frees settings. Frames that were made of them stay usable.
 *
 * @param settings May be NULL.
 */
void gridlight_settings_free(gridlight_settings *settings);

/**
 * Sets how the work is divided, and the number of groups to what the paper has for that.
 *
 * @param settings The settings.
 * @param algorithm A gridlight_algorithm.
 */
gridlight_result gridlight_settings_set_algorithm(gridlight_settings *settings, uint32_t algorithm);

/**
 * Sets the picture's size in pixels: each side up to 16384, both together up to 2^26.
 *
 * @param settings The settings.
 * @param width Pixels per row.
 * @param height Rows.
 */
gridlight_result gridlight_settings_set_size(gridlight_settings *settings,
                                             uint32_t width,
                                             uint32_t height);

/**
 * Sets the number of pixel groups, 1 to 65536; a task covers one of them.
 *
 * @param settings The settings.
 * @param groups Number of groups.
 */
gridlight_result gridlight_settings_set_groups(gridlight_settings *settings, uint32_t groups);

/**
 * Sets the number of passes of direct light, that is light samples per pixel, 1 to 65536.
 *
 * @param settings The settings.
 * @param spp Number of passes.
 */
gridlight_result gridlight_settings_set_spp(gridlight_settings *settings, uint32_t spp);

/**
 * Sets the virtual point lights of indirect light.
 *
 * @param settings The settings.
 * @param vpls VPLs in all sets together, 1 to 2^20.
 * @param vpl_sets Sets of equal size that they are divided into, 1 to 4096; divides `vpls`.
 */
gridlight_result gridlight_settings_set_vpls(gridlight_settings *settings,
                                             uint32_t vpls,
                                             uint32_t vpl_sets);

/**
 * Sets the seed of every random number.
 *
 * @param settings The settings.
 * @param seed Any number.
 */
gridlight_result gridlight_settings_set_seed(gridlight_settings *settings, uint64_t seed);

/**
 * Sets the upper bound of the geometry term cos*cos/d^2 of virtual point lights.
 *
 * @param settings The settings.
 * @param bound The bound in 1/(scene unit)^2; INFINITY for none.
 */
gridlight_result gridlight_settings_set_geometry_bound(gridlight_settings *settings, float bound);

/**
 * Sets how a pass of direct light chooses its points on the emitters.
 *
 * @param settings The settings.
 * @param light_points A gridlight_light_points.
 */
gridlight_result gridlight_settings_set_light_points(gridlight_settings *settings,
                                                     uint32_t light_points);

/**
 * Makes a frame: divides the pixels into groups and traces the virtual point lights, on all cores.
 *
 * Processors of different kinds may find lights that differ a little. Machines that render parts of one
 * picture must have the same ones: there, be a worker of a master, which sends them.
 *
 * @param scene The scene. The frame keeps what it needs of it.
 * @param settings The settings, which may be changed for the next frame afterwards.
 * @param frame_out Receives the frame; free it by gridlight_frame_free.
 * @return GRIDLIGHT_RESULT_SETTINGS if no frame can have such settings.
 */
gridlight_result gridlight_frame_new(const gridlight_scene *scene,
                                     const gridlight_settings *settings,
                                     gridlight_frame **frame_out);

/**
 * Frees a frame. Tasks and G-buffers that were made of it stay usable.
 *
 * @param frame May be NULL.
 */
void gridlight_frame_free(gridlight_frame *frame);

/**
 * How many tasks the frame has of a component: one for each pair of a group and an index.
 *
 * @param frame The frame.
 * @param component A gridlight_component.
 * @param groups_out Receives the number of groups.
 * @param indices_out Receives the number of tasks for each group: passes, or VPL sets; 0 if the frame's
 *     algorithm has no such component.
 */
gridlight_result gridlight_frame_count_tasks(const gridlight_frame *frame,
                                             uint32_t component,
                                             uint32_t *groups_out,
                                             uint32_t *indices_out);

/**
 * Traces the centres of all pixels of a frame, on all cores.
 *
 * @param frame The frame.
 * @param gbuffer_out Receives the G-buffer; free it by gridlight_gbuffer_free.
 */
gridlight_result gridlight_gbuffer_trace(const gridlight_frame *frame,
                                         gridlight_gbuffer **gbuffer_out);

/**
 * Frees a G-buffer.
 *
 * @param gbuffer May be NULL.
 */
void gridlight_gbuffer_free(gridlight_gbuffer *gbuffer);

/**
 * The diffuse albedo: R, G, B for each pixel, 0 where nothing is seen.
 *
 * @param gbuffer The G-buffer.
 * @param room Number of elements that `albedo_out` has room for; 3 * width * height are needed.
 * @param albedo_out Receives the albedo.
 */
gridlight_result gridlight_gbuffer_get_albedo(const gridlight_gbuffer *gbuffer,
                                              size_t room,
                                              float *albedo_out);

/**
 * The radiance that surfaces emit towards the eye: R, G, B for each pixel, in W/(m^2 sr). It is no part
 * of any task's light.
 *
 * @param gbuffer The G-buffer.
 * @param room Number of elements that `emission_out` has room for; 3 * width * height are needed.
 * @param emission_out Receives the emission.
 */
gridlight_result gridlight_gbuffer_get_emission(const gridlight_gbuffer *gbuffer,
                                                size_t room,
                                                float *emission_out);

/**
 * The shading normals: X, Y, Z for each pixel, of unit length, in world space, towards the eye; 0 where
 * nothing is seen.
 *
 * @param gbuffer The G-buffer.
 * @param room Number of elements that `normal_out` has room for; 3 * width * height are needed.
 * @param normal_out Receives the normals.
 */
gridlight_result gridlight_gbuffer_get_normal(const gridlight_gbuffer *gbuffer,
                                              size_t room,
                                              float *normal_out);

/**
 * The distance from the eye: a number for each pixel, in scene units; infinite where nothing is seen.
 *
 * @param gbuffer The G-buffer.
 * @param room Number of elements that `depth_out` has room for; width * height are needed.
 * @param depth_out Receives the distances.
 */
gridlight_result gridlight_gbuffer_get_depth(const gridlight_gbuffer *gbuffer,
                                             size_t room,
                                             float *depth_out);

/**
 * Makes a task. Nothing is rendered yet.
 *
 * @param frame The frame. The task keeps what it needs of it.
 * @param component A gridlight_component.
 * @param group Which pixels; see gridlight_frame_count_tasks.
 * @param index Direct: which pass. Indirect: which VPL set. Full: 0.
 * @param task_out Receives the task; free it by gridlight_task_free.
 * @return GRIDLIGHT_RESULT_TASK if the frame has no such task.
 */
gridlight_result gridlight_task_new(const gridlight_frame *frame,
                                    uint32_t component,
                                    uint32_t group,
                                    uint32_t index,
                                    gridlight_task **task_out);

/**
 * Frees a task, which must not be running.
 *
 * @param task May be NULL.
 */
void gridlight_task_free(gridlight_task *task);

/**
 * The size of a task's result.
 *
 * @param task The task.
 * @param pixels_out Receives the number of its pixels.
 * @param floats_per_pixel_out Receives how many numbers each of them gets.
 */
gridlight_result gridlight_task_get_shape(const gridlight_task *task,
                                          size_t *pixels_out,
                                          size_t *floats_per_pixel_out);

/**
 * The pixels of a task, in the order in which they are rendered. They are spread over the whole image,
 * and so is every beginning of them.
 *
 * @param task The task.
 * @param room Number of elements that `pixels_out` has room for.
 * @param pixels_out Receives for each pixel its index y * width + x, rows from the top.
 * @return GRIDLIGHT_RESULT_TOO_LITTLE_ROOM if the task has more pixels than that.
 */
gridlight_result gridlight_task_get_pixels(const gridlight_task *task,
                                           size_t room,
                                           uint32_t *pixels_out);

/**
 * Renders a task in this thread, until it is done or cancelled. Tasks of one frame may run in any number
 * of threads at once.
 *
 * What comes out is the same for the same scene, settings and task, bit for bit, and what a worker of a
 * master would send. It is radiance in W/(m^2 sr) per unit albedo: multiplied by the albedo of the
 * G-buffer it is what the pixel shows.
 *
 * @param task The task.
 * @param room Number of elements that `radiance_out` has room for: all that gridlight_task_get_shape
 *     says, pixels times numbers per pixel.
 * @param radiance_out Receives the numbers of the finished pixels, one pixel after the other.
 * @param pixels_done_out Receives how many these are: the first so many of gridlight_task_get_pixels. All
 *     of them, unless the task was cancelled.
 * @return GRIDLIGHT_RESULT_OK also for a task that was cancelled.
 */
gridlight_result gridlight_task_run(const gridlight_task *task,
                                    size_t room,
                                    float *radiance_out,
                                    size_t *pixels_done_out);

/**
 * Cancels a task, from any thread: if it runs, it returns within a few milliseconds with what it has;
 * if it is run later, it returns at once with nothing. It stays cancelled.
 *
 * @param task The task.
 */
gridlight_result gridlight_task_cancel(const gridlight_task *task);

/**
 * Makes a worker that will use all cores and have the host's name. It does nothing until it is started.
 *
 * @param master Where the master listens, as `HOST:PORT`.
 * @param worker_out Receives the worker; free it by gridlight_worker_free.
 */
gridlight_result gridlight_worker_new(const char *master,
                                      gridlight_worker **worker_out);

/**
 * Stops a worker if it runs, and frees it.
 *
 * @param worker May be NULL.
 */
void gridlight_worker_free(gridlight_worker *worker);

/**
 * Sets how many threads render, from the next start on.
 *
 * @param worker The worker, which is not started yet.
 * @param slots Number of threads, up to 1024; 0 for one on each core.
 */
gridlight_result gridlight_worker_set_slots(gridlight_worker *worker, uint32_t slots);

/**
 * Sets the name by which people know the worker.
 *
 * @param worker The worker, which is not started yet.
 * @param name The name, up to 64 bytes without control characters.
 */
gridlight_result gridlight_worker_set_name(gridlight_worker *worker, const char *name);

/**
 * Reads the key of the grid, the same as the master's: only a master that has it is believed. Without
 * one, only a master that has none lets the worker join.
 *
 * @param worker The worker, which is not started yet.
 * @param path The key file; nobody but the user who runs this program may be able to read it.
 */
gridlight_result gridlight_worker_set_key_file(gridlight_worker *worker,
                                               const char *path);

/**
 * Starts a worker and returns at once. It keeps trying until a master is there, works for it, and looks
 * for the next when that is gone. Signals are left alone, and nothing is printed.
 *
 * @param worker The worker.
 * @return GRIDLIGHT_RESULT_WORKER_STARTED if it was started or stopped before.
 */
gridlight_result gridlight_worker_start(const gridlight_worker *worker);

/**
 * Stops a worker, from any thread: its tasks end within a few milliseconds, what they have is sent, and
 * when this returns, all of its threads are gone. A BVH that it is building is finished first.
 *
 * @param worker The worker. If it does not run, nothing happens, but it cannot be started any more.
 * @return GRIDLIGHT_RESULT_WORKER if it could not work: it lacked memory for its threads, say.
 */
gridlight_result gridlight_worker_stop(const gridlight_worker *worker);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* GRIDLIGHT_H */
