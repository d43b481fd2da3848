/*
 * Is a worker of a Gridlight master until standard input ends, whatever else this program may do.
 *
 *   cc worker.c $(pkg-config --cflags --libs gridlight) -o worker
 *   ./worker master-host:7420 2
 */
#include <gridlight.h>

#include <stdio.h>
#include <stdlib.h>

/* Says why the last call failed, and gives up. */
static void require(gridlight_result result) {
    if (result != GRIDLIGHT_RESULT_OK) {
        fprintf(stderr, "worker: %s\n", gridlight_error_text());
        exit(1);
    }
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: worker HOST:PORT THREADS\n");
        return 2;
    }

    gridlight_worker *worker;
    require(gridlight_worker_new(argv[1], &worker));
    require(gridlight_worker_set_slots(worker, (uint32_t)strtoul(argv[2], NULL, 10)));
    require(gridlight_worker_set_name(worker, "a C program"));
    require(gridlight_worker_start(worker));

    /* Here the program does what it is for: draws a screen saver, say. */
    while (getchar() != EOF) {
    }

    require(gridlight_worker_stop(worker));
    gridlight_worker_free(worker);
    return 0;
}
