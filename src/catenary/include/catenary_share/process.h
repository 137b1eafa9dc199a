/* Identity of a process, distinct from that of a later process with the same PID (share/process.py). */
#ifndef CATENARY_SHARE_PROCESS_H
#define CATENARY_SHARE_PROCESS_H

#include <fcntl.h>
#include <unistd.h>

#include "share.h"

enum { CAT_PROCESS_TEXT = 64 };

typedef struct cat_this_process {
    int64_t pid;
    uint64_t start_time;
    char command[CAT_PROCESS_TEXT];   /* no zero byte at the end if it fills the array */
} cat_this_process;

/* Read at most `size` - 1 bytes of a file in /proc, and end them with a zero byte. Return their count,
 * or -1. */
static ssize_t cat_read_file(const char *path, char *text, size_t size) {
    int descriptor = open(path, O_RDONLY | O_CLOEXEC);
    ssize_t count = descriptor < 0 ? -1 : read(descriptor, text, size - 1);
    if (descriptor >= 0) close(descriptor);
    text[count > 0 ? count : 0] = '\0';
    return count;
}

/* Return the start time of a process, proc(5); 0 if it does not exist or is a zombie. */
static uint64_t cat_start_time(int64_t pid) {
    char path[64], stat[1024], *at, *rest = NULL, *word;
    int field;
    snprintf(path, sizeof path, "/proc/%lld/stat", (long long)pid);
    if (cat_read_file(path, stat, sizeof stat) <= 0) return 0;
    at = strrchr(stat, ')');          /* the command before it may contain anything */
    if (!at) return 0;
    word = strtok_r(at + 1, " ", &rest);
    if (!word || *word == 'Z' || *word == 'X') return 0;
    for (field = 0; field < 19 && word; field++) word = strtok_r(NULL, " ", &rest);
    return word ? strtoull(word, NULL, 10) : 0;
}

static void cat_boot_id(char *text, size_t size) {
    cat_read_file("/proc/sys/kernel/random/boot_id", text, size);
    text[strcspn(text, " \n")] = '\0';
}

/* Return 1 if the process still runs. Always 0 in another PID namespace. */
static int cat_is_alive(int64_t pid, uint64_t start_time, const char *boot_id) {
    char boot[CAT_PROCESS_TEXT];
    uint64_t found = cat_start_time(pid);
    if (!found || found != start_time) return 0;
    cat_boot_id(boot, sizeof boot);
    return strcmp(boot, boot_id) == 0;
}

static cat_this_process cat_identify(void) {
    cat_this_process me;
    char line[4096];
    const char *slash;
    memset(&me, 0, sizeof me);
    me.pid = getpid();
    me.start_time = cat_start_time(me.pid);
    cat_read_file("/proc/self/cmdline", line, sizeof line);  /* argv[0] ends with a zero byte */
    slash = strrchr(line, '/');
    slash = slash ? slash + 1 : line;
    memcpy(me.command, slash, strnlen(slash, sizeof me.command));
    return me;
}

#endif
