/* Description at the start of a share: decode and check it. share/layout.py writes it. */
#ifndef CATENARY_SHARE_LAYOUT_H
#define CATENARY_SHARE_LAYOUT_H

#include "json.h"
#include "share.h"

#define CAT_SHARE_MAGIC "CATSHARE"

enum {
    CAT_SHARE_VERSION = 3,
    CAT_RING_COUNT_MAX = 1 << 24,
    CAT_ROW_SIZE_MAX = 1 << 24,
    CAT_NUMBER_SIZE_MAX = 16          /* bytes of a NumPy number */
};

typedef struct cat_share_head {
    char magic[8];
    uint32_t version;
    uint32_t length;                  /* of the description [bytes] */
    uint64_t size;                    /* of the segment [bytes] */
} cat_share_head;

static int cat_is(const char *key, const char *name) { return strcmp(key, name) == 0; }

/* Decode a NumPy type such as "<f8", "|u1" or "u1". Big-endian numbers are refused. */
static void cat_decode_dtype(cat_json *j, catenary_field *field) {
    const char *dtype = cat_json_string(j);
    char *end = NULL;
    unsigned long size = 0;
    if (*dtype && strchr("<|=", *dtype)) dtype++;
    if (cat_is(dtype, "?")) dtype = "b1";
    if (*dtype && strchr("biuf", *dtype)) size = strtoul(dtype + 1, &end, 10);
    if (size < 1 || size > CAT_NUMBER_SIZE_MAX || *end) {
        cat_json_fail(j);
        return;
    }
    field->kind = *dtype;
    field->size = (uint32_t)size;
}

/* Decode a shape. The count of numbers is the product of its dimensions. */
static void cat_decode_shape(cat_json *j, catenary_field *field) {
    uint32_t items = 0;
    uint64_t count = 1;
    while (cat_json_item(j, &items)) {
        uint64_t length = cat_json_count(j);
        if (length > CAT_ROW_SIZE_MAX) cat_json_fail(j);
        else count *= length;         /* below 2^48 after this check and the next one */
        if (count > CAT_ROW_SIZE_MAX) cat_json_fail(j);
    }
    field->count = (uint32_t)count;
}

static void cat_decode_field(cat_json *j, catenary_field *field) {
    const char *key;
    uint32_t members = 0;
    memset(field, 0, sizeof *field);
    while ((key = cat_json_key(j, &members))) {
        if (cat_is(key, "name")) field->name = cat_json_string(j);
        else if (cat_is(key, "unit")) field->unit = cat_json_string(j);
        else if (cat_is(key, "dtype")) cat_decode_dtype(j, field);
        else if (cat_is(key, "shape")) cat_decode_shape(j, field);
        else if (cat_is(key, "offset")) field->offset = cat_json_count(j);
        else if (cat_is(key, "per_axis")) field->per_axis = (char)cat_json_bool(j);
        else cat_json_skip(j, 0);
    }
    if (!field->name || !field->unit || !field->size) cat_json_fail(j);
}

static void cat_decode_ring_place(cat_json *j, cat_ring_place *place) {
    const char *key;
    uint32_t members = 0;
    while ((key = cat_json_key(j, &members))) {
        if (cat_is(key, "offset")) place->offset = cat_json_count(j);
        else if (cat_is(key, "count")) place->count = cat_json_count(j);
        else if (cat_is(key, "size")) place->size = cat_json_count(j);
        else cat_json_skip(j, 0);
    }
}

static void cat_decode_process(cat_json *j, cat_process *process) {
    const char *key;
    uint32_t members = 0;
    while ((key = cat_json_key(j, &members))) {
        if (cat_is(key, "pid")) process->pid = cat_json_integer(j);
        else if (cat_is(key, "start_time")) process->start_time = cat_json_count(j);
        else if (cat_is(key, "boot_id")) process->boot_id = cat_json_string(j);
        else if (cat_is(key, "command")) process->command = cat_json_string(j);
        else cat_json_skip(j, 0);
    }
    if (!process->boot_id || !process->command) cat_json_fail(j);
}

/* Extend an array by one item. Return the new item; NULL if the memory is full. */
static void *cat_extend(void **items, uint32_t *count, size_t size) {
    void *larger = realloc(*items, (*count + (size_t)1) * size);
    if (!larger) return NULL;
    *items = larger;
    return (char *)larger + (*count)++ * size;
}

static void cat_decode_axes(cat_json *j, catenary_share *share) {
    uint32_t items = 0;
    while (cat_json_item(j, &items)) {
        const char *name = cat_json_string(j);
        void *axes = (void *)share->axes, *axis = cat_extend(&axes, &share->axis_count, sizeof name);
        share->axes = (const char **)axes;
        if (axis) memcpy(axis, &name, sizeof name);
        else cat_json_fail(j);
    }
}

static void cat_decode_fields(cat_json *j, catenary_share *share) {
    uint32_t items = 0;
    while (cat_json_item(j, &items)) {
        void *fields = share->fields, *field = cat_extend(&fields, &share->field_count, sizeof *share->fields);
        share->fields = (catenary_field *)fields;
        if (field) cat_decode_field(j, (catenary_field *)field);
        else cat_json_fail(j);
    }
}

static void cat_decode_member(cat_json *j, catenary_share *share, const char *key) {
    if (cat_is(key, "name")) share->name = cat_json_string(j);
    else if (cat_is(key, "run")) share->run = cat_json_string(j);
    else if (cat_is(key, "period")) share->period = cat_json_number(j);
    else if (cat_is(key, "axes")) cat_decode_axes(j, share);
    else if (cat_is(key, "fields")) cat_decode_fields(j, share);
    else if (cat_is(key, "clock")) share->is_virtual = cat_is(cat_json_string(j), "virtual");
    else if (cat_is(key, "utc_offset_ns")) share->utc_offset_ns = cat_json_integer(j);
    else if (cat_is(key, "writer")) cat_decode_process(j, &share->writer);
    else if (cat_is(key, "rows")) cat_decode_ring_place(j, &share->rows);
    else if (cat_is(key, "events")) cat_decode_ring_place(j, &share->events);
    else cat_json_skip(j, 0);
}

/* Return 1 if a ring lies within the segment. */
static int cat_ring_fits(const cat_ring_place *place, uint64_t size) {
    int is_power_of_two = place->count && !(place->count & (place->count - 1));
    if (!is_power_of_two || place->count > CAT_RING_COUNT_MAX) return 0;
    if (place->size < 1 || place->size > CAT_ROW_SIZE_MAX || place->offset % 64 || place->offset > size) return 0;
    return sizeof(share_ring) + place->count * ring_stride(place->size) <= size - place->offset;
}

/* Return NULL if the description is complete and all of it lies within the segment; else the reason. */
static const char *cat_layout_fault(const catenary_share *share) {
    uint32_t k;
    if (!share->name || !share->run || strlen(share->run) != 32 || !share->writer.boot_id) return "it is incomplete";
    if (!(share->period > 0.0) || !__builtin_isfinite(share->period)) return "its period is not positive";
    if (!cat_ring_fits(&share->rows, share->size) || !cat_ring_fits(&share->events, share->size)) {
        return "a ring does not fit in the segment";
    }
    for (k = 0; k < share->field_count; k++) {
        const catenary_field *field = &share->fields[k];
        uint64_t size = (uint64_t)field->count * field->size;
        if (size > share->rows.size || field->offset > share->rows.size - size) return "a field does not fit in a row";
    }
    return NULL;
}

/* Decode the description of `length` bytes after the head. */
static int cat_decode_description(catenary_share *share, uint32_t length, catenary_error *error) {
    const char *start = (const char *)share->memory + sizeof(cat_share_head), *key, *fault;
    cat_json j;
    uint32_t members = 0;
    share->text = (char *)malloc((size_t)length + 1);
    if (!share->text) return cat_fail(error, CATENARY_E_MEMORY, "out of memory");
    j.at = start;
    j.end = start + length;
    j.text = share->text;
    j.failed = 0;
    while ((key = cat_json_key(&j, &members))) cat_decode_member(&j, share, key);
    fault = j.failed ? "it is not the JSON text of a share" : cat_layout_fault(share);
    if (!fault) return 0;
    return cat_fail(error, CATENARY_E_DAMAGED, "the description of the share is invalid: %s", fault);
}

/* Decode the start of the mapped segment. */
static int cat_decode_layout(catenary_share *share, catenary_error *error) {
    cat_share_head head;
    if (share->size < sizeof head) return cat_fail(error, CATENARY_E_DAMAGED, "not a Catenary share (too short)");
    memcpy(&head, share->memory, sizeof head);
    if (memcmp(head.magic, CAT_SHARE_MAGIC, sizeof head.magic) != 0) {
        return cat_fail(error, CATENARY_E_DAMAGED, "not a Catenary share (bad magic number)");
    }
    if (head.version != CAT_SHARE_VERSION) {
        return cat_fail(error, CATENARY_E_VERSION, "the layout has version %u, but this program reads version %d; "
                        "use the same release of Catenary in both programs", head.version, CAT_SHARE_VERSION);
    }
    if (head.size > share->size || head.length > share->size - sizeof head) {
        return cat_fail(error, CATENARY_E_DAMAGED, "the share is truncated to %llu of %llu bytes",
                        (unsigned long long)share->size, (unsigned long long)head.size);
    }
    return cat_decode_description(share, head.length, error);
}

#endif
