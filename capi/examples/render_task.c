/*
 * Renders one task of a scene and writes its light to a file, as floats R, G, B for each pixel.
 *
 *   cc render_task.c $(pkg-config --cflags --libs gridlight) -pthread -o render_task
 *   ./render_task scenes/cornell-box/cornell-box.toml light.raw
 *   ./render_task scenes/cornell-box/cornell-box.toml light.raw 0.5
 *
 * With a number of seconds, another thread cancels the task after that time. What was done until then
 * is written: pixels that are spread over the whole image.
 */
#include <gridlight.h>

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

struct cancellation {
    const gridlight_task *task;
    double seconds;
};

static void *cancel_later(void *argument) {
    const struct cancellation *cancellation = argument;
    struct timespec time;
    double whole;
    time.tv_nsec = (long)(modf(cancellation->seconds, &whole) * 1e9);
    time.tv_sec = (time_t)whole;
    nanosleep(&time, NULL);
    gridlight_task_cancel(cancellation->task);
    return NULL;
}

/* Says why the last call failed, and gives up. */
static void require(gridlight_result result) {
    if (result != GRIDLIGHT_RESULT_OK) {
        fprintf(stderr, "render_task: %s\n", gridlight_error_text());
        exit(1);
    }
}

static void write_floats(const char *path, const float *values, size_t count) {
    FILE *file = fopen(path, "wb");
    if (file == NULL || fwrite(values, sizeof *values, count, file) != count || fclose(file) != 0) {
        perror(path);
        exit(1);
    }
}

int main(int argc, char **argv) {
    if (argc < 3 || argc > 4) {
        fprintf(stderr, "usage: render_task SCENE OUT [SECONDS]\n");
        return 2;
    }

    /* A scene, with what people should know about it. */
    gridlight_scene *scene;
    require(gridlight_scene_load(argv[1], &scene));
    for (size_t i = 0; gridlight_scene_note(scene, i) != NULL; i++) {
        fprintf(stderr, "render_task: %s\n", gridlight_scene_note(scene, i));
    }

    /* A frame of it. The frame keeps what it needs of scene and settings. */
    gridlight_settings *settings;
    gridlight_frame *frame;
    require(gridlight_settings_new(scene, &settings));
    require(gridlight_settings_set_size(settings, 256, 192));
    require(gridlight_settings_set_groups(settings, 16));
    require(gridlight_settings_set_vpls(settings, 256, 4));
    require(gridlight_frame_new(scene, settings, &frame));
    gridlight_settings_free(settings);
    gridlight_scene_free(scene);

    /* A task of the frame: the light of VPL set 2 for pixel group 5. */
    gridlight_task *task;
    size_t pixels, floats_per_pixel, pixels_done;
    require(gridlight_task_new(frame, GRIDLIGHT_COMPONENT_INDIRECT, 5, 2, &task));
    require(gridlight_task_get_shape(task, &pixels, &floats_per_pixel));
    size_t room = pixels * floats_per_pixel;
    float *radiance = malloc(room * sizeof *radiance);
    if (radiance == NULL) {
        perror("render_task");
        return 1;
    }

    /* Rendered in this thread; perhaps cancelled by another. */
    struct cancellation cancellation = {task, argc == 4 ? atof(argv[3]) : 0.0};
    pthread_t canceller;
    int is_cancellable = argc == 4 && pthread_create(&canceller, NULL, cancel_later, &cancellation) == 0;
    require(gridlight_task_run(task, room, radiance, &pixels_done));
    if (is_cancellable) {
        pthread_join(canceller, NULL);
    }
    printf("%zu of %zu pixels\n", pixels_done, pixels);
    write_floats(argv[2], radiance, pixels_done * floats_per_pixel);

    free(radiance);
    gridlight_task_free(task);
    gridlight_frame_free(frame);
    return 0;
}
