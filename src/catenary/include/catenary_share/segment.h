/* Open a share, and read its cycles. */
#ifndef CATENARY_SHARE_SEGMENT_H
#define CATENARY_SHARE_SEGMENT_H

#include <math.h>
#include <sys/mman.h>
#include <time.h>

#include "folder.h"
#include "layout.h"

static const int64_t CAT_SECOND_NS = 1000000000;
static const int64_t CAT_ALIVE_CHECK_NS = 250000000;  /* interval at which the process of the loop is checked */

static int64_t cat_now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * CAT_SECOND_NS + now.tv_nsec;
}

/* Check the file and map it. The caller closes the descriptor. */
static int cat_map(catenary_share *share, const char *path, int descriptor, const cat_search *search,
                   catenary_error *error) {
    struct stat status;
    if (fstat(descriptor, &status) != 0) return cat_fail(error, CATENARY_E_SYSTEM, "%s: %s", path, strerror(errno));
    if (!cat_is_trusted(search, status.st_uid)) {
        return cat_fail(error, CATENARY_E_NOT_TRUSTED, "%s belongs to another user (%u)", path, (unsigned)status.st_uid);
    }
    if (!S_ISREG(status.st_mode) || status.st_size <= 0) {
        return cat_fail(error, CATENARY_E_DAMAGED, "%s is empty or not a regular file", path);
    }
    share->memory = mmap(NULL, (size_t)status.st_size, PROT_READ, MAP_SHARED, descriptor, 0);
    if (share->memory == MAP_FAILED) {
        share->memory = NULL;
        return cat_fail(error, CATENARY_E_SYSTEM, "cannot map %s: %s", path, strerror(errno));
    }
    share->size = (uint64_t)status.st_size;
    share->owner = status.st_uid;
    return 0;
}

static int cat_open_file(catenary_share *share, const char *name, int64_t uid, catenary_error *error) {
    cat_search search = cat_search_of(uid);
    char folder[CAT_FOLDER_SIZE], path[CAT_FOLDER_SIZE + CAT_NAME_MAX + 16];
    int descriptor, code = cat_find_folder(&search, name, folder, error);
    if (code) return code;
    snprintf(path, sizeof path, "%s/share-%s", folder, name);
    snprintf(share->socket, sizeof share->socket, "%.40s/socket-%.64s", folder, name);
    descriptor = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (descriptor < 0) {
        code = errno == ENOENT ? CATENARY_E_NOT_FOUND : errno == EACCES ? CATENARY_E_PERMISSION : CATENARY_E_DAMAGED;
        return cat_fail(error, code, "cannot open %s: %s", path, strerror(errno));
    }
    code = cat_map(share, path, descriptor, &search, error);
    close(descriptor);
    return code;
}

static int cat_open_share(catenary_share *share, const char *name, int64_t uid, int flags, catenary_error *error) {
    int code = cat_open_file(share, name, uid, error);
    if (!code) code = cat_decode_layout(share, error);
    if (code) return code;
    share->cycles.ring = (share_ring *)((char *)share->memory + share->rows.offset);
    share->cycles.count = share->rows.count;
    share->cycles.size = share->rows.size;
    share->cycles.stride = ring_stride(share->rows.size);
    if (flags & CATENARY_STALE || catenary_state(share) != CATENARY_DEAD) return 0;
    return cat_fail(error, CATENARY_E_DEAD, "the share '%s' is stale: process %lld (%s) has died", name,
                    (long long)share->writer.pid, share->writer.command);
}

int catenary_open(catenary_share **share, const char *name, int64_t uid, int flags, catenary_error *error) {
    int code;
    if (!share) return cat_fail(error, CATENARY_E_ARGUMENT, "share is NULL");
    *share = NULL;
    if (!name || !cat_is_name(name)) {
        return cat_fail(error, CATENARY_E_ARGUMENT, "invalid name: use 1 to 64 letters, digits, '.', '_' or '-', and "
                        "begin with a letter or digit");
    }
    if (uid < CATENARY_OWN_UID || uid > UINT32_MAX) {
        return cat_fail(error, CATENARY_E_ARGUMENT, "%lld is not a user id", (long long)uid);
    }
    *share = (catenary_share *)calloc(1, sizeof **share);
    if (!*share) return cat_fail(error, CATENARY_E_MEMORY, "out of memory");
    code = cat_open_share(*share, name, uid, flags, error);
    if (code) {
        catenary_close(*share);
        *share = NULL;
    }
    return code;
}

double catenary_period(const catenary_share *share) { return share->period; }
int64_t catenary_utc_offset_ns(const catenary_share *share) { return share->utc_offset_ns; }
int catenary_is_virtual(const catenary_share *share) { return share->is_virtual; }
int64_t catenary_writer_pid(const catenary_share *share) { return share->writer.pid; }
uint32_t catenary_axis_count(const catenary_share *share) { return share->axis_count; }
uint32_t catenary_field_count(const catenary_share *share) { return share->field_count; }
size_t catenary_row_size(const catenary_share *share) { return (size_t)share->rows.size; }
uint64_t catenary_newest(const catenary_share *share) { return ring_newest(&share->cycles); }

const char *catenary_axis_name(const catenary_share *share, uint32_t axis) {
    return axis < share->axis_count ? share->axes[axis] : NULL;
}

int64_t catenary_find_axis(const catenary_share *share, const char *name) {
    uint32_t k;
    for (k = 0; name && k < share->axis_count; k++) {
        if (cat_is(share->axes[k], name)) return k;
    }
    return -1;
}

const catenary_field *catenary_field_at(const catenary_share *share, uint32_t k) {
    return k < share->field_count ? &share->fields[k] : NULL;
}

const catenary_field *catenary_find_field(const catenary_share *share, const char *name) {
    uint32_t k;
    for (k = 0; name && k < share->field_count; k++) {
        if (cat_is(share->fields[k].name, name)) return &share->fields[k];
    }
    return NULL;
}

int catenary_state(const catenary_share *share) {
    const cat_process *writer = &share->writer;
    if (ring_is_ended(&share->cycles)) return CATENARY_ENDED;
    return cat_is_alive(writer->pid, writer->start_time, writer->boot_id) ? CATENARY_RUNNING : CATENARY_DEAD;
}

/* Return 0 while the loop runs. */
static int cat_check_running(const catenary_share *share, catenary_error *error) {
    int state = catenary_state(share);
    if (state == CATENARY_RUNNING) return 0;
    if (state == CATENARY_ENDED) {
        return cat_fail(error, CATENARY_E_ENDED, "the loop of the share '%s' has ended", share->name);
    }
    return cat_fail(error, CATENARY_E_DEAD, "the loop's process has died: process %lld (%s)",
                    (long long)share->writer.pid, share->writer.command);
}

static int64_t cat_deadline_ns(double timeout) {
    if (timeout < 0.0 || timeout > 1e9) return INT64_MAX;
    return cat_now_ns() + (int64_t)(timeout * 1e9);
}

int catenary_wait(const catenary_share *share, uint64_t seen, double timeout, catenary_error *error) {
    int64_t deadline = cat_deadline_ns(timeout);
    for (;;) {
        int64_t check = cat_now_ns() + CAT_ALIVE_CHECK_NS;
        int code, found = ring_wait(&share->cycles, seen, check < deadline ? check : deadline);
        if (found == 1) return 1;
        if (found == -EINTR) return cat_fail(error, CATENARY_E_INTERRUPTED, "a signal has interrupted the wait");
        if (found < 0) return cat_fail(error, CATENARY_E_SYSTEM, "cannot wait for a cycle: %s", strerror(-found));
        code = cat_check_running(share, error);
        if (code) return catenary_newest(share) > seen ? 1 : code;  /* it may have come before the check */
        if (cat_now_ns() >= deadline) return 0;
    }
}

static int cat_check_row(const catenary_share *share, const void *row, size_t size, catenary_error *error) {
    if (row && size >= share->rows.size) return 0;
    return cat_fail(error, CATENARY_E_ARGUMENT, "the row needs %llu bytes", (unsigned long long)share->rows.size);
}

int catenary_read(const catenary_share *share, void *row, size_t size, uint64_t *number, catenary_error *error) {
    uint64_t newest;
    int code = cat_check_row(share, row, size, error);
    if (code) return code;
    newest = ring_copy_newest(&share->cycles, (uint8_t *)row);
    if (number) *number = newest;
    return newest ? 0 : cat_fail(error, CATENARY_E_EMPTY, "the share '%s' has no cycle yet", share->name);
}

int catenary_read_cycle(const catenary_share *share, uint64_t number, void *row, size_t size, catenary_error *error) {
    int code = cat_check_row(share, row, size, error);
    if (code) return code;
    if (number && number <= catenary_newest(share) && ring_copy(&share->cycles, number, (uint8_t *)row)) return 0;
    return cat_fail(error, CATENARY_E_OVERWRITTEN, "the share '%s' does not store cycle %llu", share->name,
                    (unsigned long long)number);
}

/* Copy a number of the given C type from the bytes at `at`. */
#define CAT_NUMBER(type) do { type number; memcpy(&number, at, sizeof number); return (double)number; } while (0)

static double cat_real(const char *at, uint32_t size) {
    if (size == 4) CAT_NUMBER(float);
    if (size == 8) CAT_NUMBER(double);
    return NAN;
}

static double cat_signed(const char *at, uint32_t size) {
    if (size == 1) CAT_NUMBER(int8_t);
    if (size == 2) CAT_NUMBER(int16_t);
    if (size == 4) CAT_NUMBER(int32_t);
    if (size == 8) CAT_NUMBER(int64_t);
    return NAN;
}

static double cat_unsigned(const char *at, uint32_t size) {
    if (size == 1) CAT_NUMBER(uint8_t);
    if (size == 2) CAT_NUMBER(uint16_t);
    if (size == 4) CAT_NUMBER(uint32_t);
    if (size == 8) CAT_NUMBER(uint64_t);
    return NAN;
}

double catenary_value(const catenary_field *field, const void *row, uint32_t k) {
    const char *at;
    if (!field || !row || k >= field->count) return NAN;
    at = (const char *)row + field->offset + (size_t)k * field->size;
    if (field->kind == 'f') return cat_real(at, field->size);
    return field->kind == 'i' ? cat_signed(at, field->size) : cat_unsigned(at, field->size);
}

#endif
