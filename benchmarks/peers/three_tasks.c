/* The three busy tasks of the published experiment, in C.
 *
 *     three_tasks CPU SECONDS FILE  PERIOD_NS EXECUTION_NS PRIORITY ...
 *
 * CPU -1: any. Each task is a thread under SCHED_FIFO, if permitted. In every job, it uses its
 * execution time of processor time. For each task, FILE receives the number of jobs and four int64
 * [ns] per job: start to start, release to start, release to end, and the processor time from this
 * start to the next, including waiting and waking (for the last job, to its end). */
#include "machine.h"

#include <stdlib.h>
#include <string.h>

enum { TASKS_MAX = 8, FIGURES = 4 };
enum { LEAD_NS = 100000000 }; /* time to create the threads, whose whole stacks are locked */

struct task {
    int64_t period, execution, origin, jobs, done;
    int priority;
    int64_t *samples;
};

static void *run(void *argument) {
    struct task *task = argument;
    be_real_time(task->priority);
    int64_t before = 0, began = 0;
    for (int64_t job = 0; job < task->jobs; job++) {
        int64_t release = task->origin + job * task->period;
        wait_until(release);
        int64_t start = now_ns(CLOCK_MONOTONIC);
        int64_t begun = now_ns(CLOCK_THREAD_CPUTIME_ID), used;
        do used = now_ns(CLOCK_THREAD_CPUTIME_ID) - begun;
        while (used < task->execution);
        int64_t *s = task->samples + job * FIGURES;
        if (job) s[3 - FIGURES] = begun - began;
        began = begun;
        s[0] = job ? start - before : task->period;
        s[1] = start - release;
        s[2] = now_ns(CLOCK_MONOTONIC) - release;
        s[3] = used;
        before = start;
        task->done++;
    }
    return NULL;
}

int main(int count, char **words) {
    static struct task tasks[TASKS_MAX];
    pthread_t threads[TASKS_MAX];
    int n = (count - 4) / 3, cpu = count > 4 ? atoi(words[1]) : -1;
    if (count < 7 || n > TASKS_MAX || (count - 4) % 3) {
        fprintf(stderr, "three_tasks CPU SECONDS FILE  PERIOD_NS EXECUTION_NS PRIORITY ...\n");
        return 2;
    }
    stay_on(cpu);
    lock_memory();
    /* Above all tasks, which inherit it. Otherwise, the first task would delay the creation of the
     * last. */
    struct sched_param above = {.sched_priority = sched_get_priority_max(SCHED_FIFO) - 1};
    if (sched_setscheduler(0, SCHED_FIFO, &above)) perror("SCHED_FIFO");
    int64_t origin = now_ns(CLOCK_MONOTONIC) + LEAD_NS;
    for (int i = 0; i < n; i++) {
        struct task *task = &tasks[i];
        task->period = atoll(words[4 + 3 * i]);
        task->execution = atoll(words[5 + 3 * i]);
        task->priority = atoi(words[6 + 3 * i]);
        task->origin = origin;
        if (task->period <= 0) return 2;
        task->jobs = (int64_t)(atof(words[2]) * 1e9) / task->period;
        if (task->jobs < 1) task->jobs = 1;
        size_t size = (size_t)(task->jobs * FIGURES) * sizeof *task->samples;
        task->samples = malloc(size);
        if (!task->samples) return 1;
        memset(task->samples, 1, size); /* touch the pages */
    }
    for (int i = 0; i < n; i++)
        if (pthread_create(&threads[i], NULL, run, &tasks[i])) { perror("thread"); return 1; }
    for (int i = 0; i < n; i++) pthread_join(threads[i], NULL);
    FILE *file = fopen(words[3], "wb");
    for (int i = 0; file && i < n; i++) {
        size_t size = (size_t)(tasks[i].done * FIGURES);
        if (fwrite(&tasks[i].done, sizeof tasks[i].done, 1, file) != 1
            || fwrite(tasks[i].samples, sizeof *tasks[i].samples, size, file) != size) break;
    }
    if (!file || fclose(file)) { perror(words[3]); return 1; }
    return 0;
}
