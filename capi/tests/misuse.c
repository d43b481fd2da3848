/*
 * What the library does with calls that make no sense, and with a task that is cancelled. Ends with 0 if
 * everything is as include/gridlight.h says.
 *
 *   ./misuse SCENE
 */
#include <gridlight.h>

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define CHECK(condition)                                                       \
    do {                                                                       \
        if (!(condition)) {                                                    \
            fprintf(stderr, "%s:%d: %s does not hold; the library says: %s\n", \
                    __FILE__, __LINE__, #condition, gridlight_error_text());   \
            exit(1);                                                           \
        }                                                                      \
    } while (0)

#define OK(call) CHECK((call) == GRIDLIGHT_RESULT_OK)
#define FAILS(call, result) CHECK((call) == GRIDLIGHT_RESULT_##result)
#define SAYS(text) CHECK(strstr(gridlight_error_text(), text) != NULL)

static void null_is_refused_by_name_and_may_be_freed(const char *path) {
    gridlight_scene *scene = NULL;
    FAILS(gridlight_scene_load(NULL, &scene), NULL_PARAMETER);
    SAYS("`path` is NULL");
    FAILS(gridlight_scene_load(path, NULL), NULL_PARAMETER);
    SAYS("`scene_out` is NULL");
    FAILS(gridlight_task_cancel(NULL), NULL_PARAMETER);
    FAILS(gridlight_worker_start(NULL), NULL_PARAMETER);
    CHECK(gridlight_scene_note(NULL, 0) == NULL);
    gridlight_scene_free(NULL);
    gridlight_settings_free(NULL);
    gridlight_frame_free(NULL);
    gridlight_task_free(NULL);
    gridlight_gbuffer_free(NULL);
    gridlight_worker_free(NULL);
}

static void a_scene_that_cannot_be_read_is_named(void) {
    gridlight_scene *scene = (gridlight_scene *)&scene;
    FAILS(gridlight_scene_load("no-such-scene.toml", &scene), SCENE);
    SAYS("no-such-scene.toml");
    CHECK(scene == (gridlight_scene *)&scene); /* not written */
    FAILS(gridlight_scene_load("\xff.toml", &scene), INVALID_PARAMETER);
    SAYS("`path` is not UTF-8");
}

static void *text_of_another_thread(void *unused) {
    (void)unused;
    return strlen(gridlight_error_text()) == 0 ? NULL : (void *)"not empty";
}

static void errors_are_kept_for_each_thread(void) {
    pthread_t thread;
    void *result;
    FAILS(gridlight_task_cancel(NULL), NULL_PARAMETER);
    CHECK(pthread_create(&thread, NULL, text_of_another_thread, NULL) == 0);
    CHECK(pthread_join(thread, &result) == 0 && result == NULL);
    SAYS("`task` is NULL");
}

static void impossible_settings_make_no_frame(const gridlight_scene *scene) {
    gridlight_settings *settings;
    gridlight_frame *frame = NULL;
    OK(gridlight_settings_new(scene, &settings));
    FAILS(gridlight_settings_set_algorithm(settings, 7), INVALID_PARAMETER);
    FAILS(gridlight_settings_set_light_points(settings, 7), INVALID_PARAMETER);
    OK(gridlight_settings_set_vpls(settings, 7, 2));
    FAILS(gridlight_frame_new(scene, settings, &frame), SETTINGS);
    SAYS("7 VPLs");
    OK(gridlight_settings_set_vpls(settings, 8, 2));
    OK(gridlight_settings_set_geometry_bound(settings, -1.0f));
    FAILS(gridlight_frame_new(scene, settings, &frame), SETTINGS);
    OK(gridlight_settings_set_geometry_bound(settings, INFINITY));
    OK(gridlight_settings_set_size(settings, 0, 10));
    FAILS(gridlight_frame_new(scene, settings, &frame), SETTINGS);
    CHECK(frame == NULL);
    gridlight_settings_free(settings);
}

/* A frame of one group, of which a task takes seconds. */
static gridlight_frame *large_frame(const gridlight_scene *scene) {
    gridlight_settings *settings;
    gridlight_frame *frame;
    OK(gridlight_settings_new(scene, &settings));
    OK(gridlight_settings_set_size(settings, 512, 512));
    OK(gridlight_settings_set_groups(settings, 1));
    OK(gridlight_settings_set_spp(settings, 3));
    OK(gridlight_settings_set_vpls(settings, 1024, 1));
    OK(gridlight_settings_set_seed(settings, 7));
    OK(gridlight_settings_set_light_points(settings, GRIDLIGHT_LIGHT_POINTS_PER_PIXEL));
    OK(gridlight_frame_new(scene, settings, &frame));
    gridlight_settings_free(settings);
    return frame;
}

static void a_frame_has_the_tasks_that_it_counts(const gridlight_frame *frame) {
    uint32_t groups, indices;
    gridlight_task *task = NULL;
    OK(gridlight_frame_count_tasks(frame, GRIDLIGHT_COMPONENT_DIRECT, &groups, &indices));
    CHECK(groups == 1 && indices == 3);
    OK(gridlight_frame_count_tasks(frame, GRIDLIGHT_COMPONENT_FULL, &groups, &indices));
    CHECK(groups == 1 && indices == 0);
    FAILS(gridlight_frame_count_tasks(frame, 9, &groups, &indices), INVALID_PARAMETER);
    FAILS(gridlight_task_new(frame, GRIDLIGHT_COMPONENT_DIRECT, 0, 3, &task), TASK);
    FAILS(gridlight_task_new(frame, GRIDLIGHT_COMPONENT_DIRECT, 1, 0, &task), TASK);
    FAILS(gridlight_task_new(frame, 9, 0, 0, &task), INVALID_PARAMETER);
    CHECK(task == NULL);
}

static void the_gbuffer_has_its_layers(const gridlight_frame *frame) {
    size_t pixels = 512 * 512;
    float *values = malloc(3 * pixels * sizeof *values);
    gridlight_gbuffer *gbuffer;
    CHECK(values != NULL);
    OK(gridlight_gbuffer_trace(frame, &gbuffer));
    OK(gridlight_gbuffer_get_albedo(gbuffer, 3 * pixels, values));
    OK(gridlight_gbuffer_get_emission(gbuffer, 3 * pixels, values));
    OK(gridlight_gbuffer_get_normal(gbuffer, 3 * pixels, values));
    for (size_t i = 0; i < pixels; i++) {
        const float *n = &values[3 * i];
        float length = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        CHECK(length == 0.0f || fabsf(length - 1.0f) < 1e-5f);
    }
    OK(gridlight_gbuffer_get_depth(gbuffer, pixels, values));
    CHECK(values[pixels / 2] > 0.0f);
    FAILS(gridlight_gbuffer_get_depth(gbuffer, pixels - 1, values), TOO_LITTLE_ROOM);
    SAYS("262143");
    gridlight_gbuffer_free(gbuffer);
    free(values);
}

struct run {
    const gridlight_task *task;
    size_t room, pixels_done;
    float *radiance;
    gridlight_result result;
};

static void *run(void *argument) {
    struct run *run = argument;
    run->result = gridlight_task_run(run->task, run->room, run->radiance, &run->pixels_done);
    return NULL;
}

static void a_cancelled_task_ends_with_the_pixels_that_it_has(const gridlight_frame *frame) {
    size_t pixels, floats_per_pixel;
    gridlight_task *task;
    OK(gridlight_task_new(frame, GRIDLIGHT_COMPONENT_INDIRECT, 0, 0, &task));
    OK(gridlight_task_get_shape(task, &pixels, &floats_per_pixel));
    CHECK(pixels == 512 * 512 && floats_per_pixel == 3);
    size_t room = pixels * floats_per_pixel;
    struct run started = {task, room, 0, malloc(room * sizeof(float)), GRIDLIGHT_RESULT_PANIC};
    CHECK(started.radiance != NULL);
    FAILS(gridlight_task_run(task, room - 1, started.radiance, &started.pixels_done), TOO_LITTLE_ROOM);

    pthread_t thread;
    struct timespec time = {0, 200 * 1000 * 1000};
    CHECK(pthread_create(&thread, NULL, run, &started) == 0);
    nanosleep(&time, NULL);
    OK(gridlight_task_cancel(task));
    CHECK(pthread_join(thread, NULL) == 0);
    CHECK(started.result == GRIDLIGHT_RESULT_OK);
    CHECK(started.pixels_done < pixels);

    /* It stays cancelled. */
    OK(gridlight_task_run(task, room, started.radiance, &started.pixels_done));
    CHECK(started.pixels_done == 0);
    free(started.radiance);
    gridlight_task_free(task);
}

static void a_worker_wants_an_address_and_is_started_once(void) {
    gridlight_worker *worker = NULL;
    FAILS(gridlight_worker_new("nowhere", &worker), INVALID_PARAMETER);
    SAYS("nowhere");
    CHECK(worker == NULL);
    /* Nobody listens at port 1. */
    OK(gridlight_worker_new("127.0.0.1:1", &worker));
    FAILS(gridlight_worker_set_slots(worker, 100000), INVALID_PARAMETER);
    FAILS(gridlight_worker_set_name(worker, "two\nlines"), INVALID_PARAMETER);
    FAILS(gridlight_worker_set_key_file(worker, "/nowhere/grid.key"), INVALID_PARAMETER);
    OK(gridlight_worker_set_slots(worker, 1));
    OK(gridlight_worker_start(worker));
    FAILS(gridlight_worker_start(worker), WORKER_STARTED);
    OK(gridlight_worker_stop(worker));
    OK(gridlight_worker_stop(worker));
    FAILS(gridlight_worker_start(worker), WORKER_STARTED);
    gridlight_worker_free(worker);

    /* One that runs is stopped when it is freed. */
    OK(gridlight_worker_new("127.0.0.1:1", &worker));
    OK(gridlight_worker_start(worker));
    gridlight_worker_free(worker);
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: misuse SCENE\n");
        return 2;
    }
    CHECK(strlen(gridlight_version()) > 0 && strlen(gridlight_error_text()) == 0);
    null_is_refused_by_name_and_may_be_freed(argv[1]);
    a_scene_that_cannot_be_read_is_named();
    errors_are_kept_for_each_thread();

    gridlight_scene *scene;
    uint32_t width, height;
    OK(gridlight_scene_load(argv[1], &scene));
    OK(gridlight_scene_get_size(scene, &width, &height));
    CHECK(width > 0 && height > 0);
    impossible_settings_make_no_frame(scene);
    gridlight_frame *frame = large_frame(scene);
    gridlight_scene_free(scene);
    a_frame_has_the_tasks_that_it_counts(frame);
    the_gbuffer_has_its_layers(frame);
    a_cancelled_task_ends_with_the_pixels_that_it_has(frame);
    gridlight_frame_free(frame);

    a_worker_wants_an_address_and_is_started_once();
    return 0;
}
