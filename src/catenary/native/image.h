/* The image table: how a cycle exchanges its process images with whatever carries them:
 * our frame engine on a link, or (later) libethercat.
 *
 * `emit` sends the output image, `collect` fills the input image. A sync unit is valid in this
 * cycle when all of its datagrams came back with the expected working counter; the inputs of an
 * invalid unit keep their last good values. A unit may be exchanged every few cycles only; in the
 * others it stays as it was.
 */
#ifndef CATENARY_IMAGE_H
#define CATENARY_IMAGE_H

#include <stdint.h>

#define CAT_IMAGE_CAPSULE "catenary.image"
#define CAT_IMAGE_VERSION 3u

typedef struct cat_image {
    uint32_t version;                 /* CAT_IMAGE_VERSION */
    uint32_t unit_count;
    uint32_t output_size;             /* bytes */
    uint32_t input_size;              /* bytes */
    void *self;
    uint8_t *outputs;                 /* output_size bytes, written by the cycle before emit */
    const uint8_t *inputs;            /* input_size bytes, valid after collect */
    const uint8_t *unit_valid;        /* unit_count flags, of each unit's last exchange */
    const uint8_t *unit_fresh;        /* unit_count flags: exchanged in the last collect, and valid */
    const uint32_t *unit_missed;      /* unit_count numbers: exchanges in a row that were not valid */
    const uint16_t *unit_counter;     /* unit_count sums of working counters, of the last exchange */
    const uint8_t *ok;                /* one flag, of the last collect: every unit exchanged that is not
                                       * optional is valid and no frame that others need is missing */
    const uint8_t *whole;             /* one flag: every unit that is not optional is valid */
    const uint8_t *al_status;         /* one byte: OR of all AL states, bit 4: some device signals an error */
    const uint16_t *al_counter;       /* one value: devices that answered for it in the last collect */
    const int64_t *frame_stamp;       /* one value: when a collect with a deadline saw its last frame [ns] */

    /* Sends the frames of this cycle. 0, or -errno of the first frame that could not go. */
    int (*emit)(void *self);

    /* Drains what has arrived and, until `deadline` [ns, link clock; 0: never waits], waits for
     * the rest of the frames of the last emit. Number of its frames still missing (0: all back),
     * or -errno. It may be called again before the next emit: a unit is missed once an emit, and
     * where all are back already nothing changes any more. */
    int (*collect)(void *self, int64_t deadline);

    /* Takes what has arrived, between two cycles: judges nothing, waits for nothing. */
    void (*drain)(void *self);

    /* Copies the output image into the frames of the next emit, which then need not do it; NULL: not
     * offered. To be called again after each later change of the output image before that emit. */
    void (*fill)(void *self);
} cat_image;

#endif
