/* Private structures of catenary_share.h, and errors. */
#ifndef CATENARY_SHARE_SHARE_H
#define CATENARY_SHARE_SHARE_H

#ifndef _GNU_SOURCE
#error "define _GNU_SOURCE before the first #include, or compile catenary_share.c"
#endif

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>

#include "../../native/atomics.h"
#include "../../share/ring.h"
#include "../catenary_share.h"

typedef struct cat_process {
    int64_t pid;
    uint64_t start_time;              /* clock ticks after the boot */
    const char *boot_id;
    const char *command;
} cat_process;

typedef struct cat_ring_place {
    uint64_t offset;                  /* [bytes] */
    uint64_t count;                   /* of rows */
    uint64_t size;                    /* of a row [bytes] */
} cat_ring_place;

struct catenary_share {
    void *memory;                     /* the segment, read-only */
    uint64_t size;                    /* [bytes] */
    uid_t owner;
    char socket[160];                 /* path of the desk's socket */
    char *text;                       /* all texts of the description */
    const char *name;
    const char *run;
    double period;                    /* [s] */
    int64_t utc_offset_ns;
    int is_virtual;
    cat_process writer;
    const char **axes;
    uint32_t axis_count;
    catenary_field *fields;
    uint32_t field_count;
    cat_ring_place rows, events;
    ring_view cycles;
    uint8_t *desk;                    /* memory for commands; NULL until it is needed */
};

/* Write the code and a text to `error`, which may be NULL. Return the code. */
__attribute__((format(printf, 3, 4)))
static int cat_fail(catenary_error *error, int code, const char *format, ...) {
    va_list values;
    char *c;
    if (!error) return code;
    error->code = code;
    va_start(values, format);
    vsnprintf(error->text, sizeof error->text, format, values);
    va_end(values);
    for (c = error->text; *c; c++) {  /* names of processes can contain control characters */
        if ((unsigned char)*c < 0x20 || *c == 0x7f) *c = '?';
    }
    return code;
}

#endif
