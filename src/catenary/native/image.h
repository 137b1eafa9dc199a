/* The image table: the functions with which a cycle exchanges its process images with a master.
 * The master is our frame engine on a link, or libethercat.
 *
 * `emit` sends the output image, `collect` fills the input image. A sync unit is valid in a cycle
 * if all of its datagrams returned with the expected working counter. The inputs of an invalid unit
 * keep their last valid values. A unit with a divider is
 * exchanged every `divider` cycles and does not change in between.
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
    const uint8_t *unit_valid;        /* unit_count flags: result of each unit's last exchange */
    const uint8_t *unit_fresh;        /* unit_count flags: exchanged in the last collect, and valid */
    const uint32_t *unit_missed;      /* unit_count numbers: invalid exchanges in a row */
    const uint16_t *unit_counter;     /* unit_count sums of working counters in the last exchange */
    const uint8_t *ok;                /* one flag, of the last collect: every required unit that was exchanged
                                       * is valid, and every required frame has returned */
    const uint8_t *whole;             /* one flag: every required unit is valid */
    const uint8_t *al_status;         /* one byte: OR of all AL states; bit 4: a device reports an error */
    const uint16_t *al_counter;       /* one value: devices that answered the AL status datagram in the last collect */
    const int64_t *frame_stamp;       /* one value: time at which a collect with a deadline received its last frame [ns] */

    /* Sends the frames of this cycle. Returns 0, or -errno of the first frame that failed. */
    int (*emit)(void *self);

    /* Reads the frames that have arrived and waits for the others of the last emit until `deadline`
     * [ns, link clock; 0: no wait]. Returns the number of frames that are still missing, or -errno.
     * It may be called again before the next emit. A unit is counted as missed at most once per
     * emit. Once all frames have returned, further calls change nothing. */
    int (*collect)(void *self, int64_t deadline);

    /* Reads the frames that have arrived between two cycles, without evaluating them or waiting. */
    void (*drain)(void *self);

    /* Copies the output image into the frames of the next emit, to save time in that emit. NULL if
     * not supported. If the output image changes before that emit, call it again. */
    void (*fill)(void *self);
} cat_image;

#endif
