/* The link table: the functions with which the compiled core, the compiled wrappers and the virtual
 * segment exchange Ethernet frames without Python.
 *
 * A link carries whole Ethernet frames: destination MAC first, no preamble, no FCS.
 * One thread uses a link at a time; nothing here allocates or raises.
 * Python passes the table in a capsule named CAT_LINK_CAPSULE. The holder of the table keeps
 * the Python object that owns it alive.
 */
#ifndef CATENARY_LINK_H
#define CATENARY_LINK_H

#include <stdint.h>

#define CAT_LINK_CAPSULE "catenary.link"
#define CAT_LINK_VERSION 1u
#define CAT_FRAME_MAX 1514u           /* header + 1500 bytes of payload, without FCS */
#define CAT_FRAME_MIN 60u             /* shorter frames are padded before they are sent */

/* flags */
#define CAT_LINK_VIRTUAL_TIME 1u      /* `now` advances only in a wait or `spend`; cycles run in the caller's thread */
#define CAT_LINK_SHARED_TIME 2u       /* other participants share the virtual time: release the GIL to wait */
#define CAT_LINK_SPENDS 4u            /* `spend` is implemented */
#define CAT_LINK_POLLS 8u             /* `fd` is valid: readable when a frame can be received */
#define CAT_LINK_FORETELLS 16u        /* `due` is implemented */

typedef struct cat_link {
    uint32_t version;                 /* CAT_LINK_VERSION */
    uint32_t flags;
    void *self;

    /* Sends one frame. Returns 0 or -errno, such as -ENOBUFS (the NIC's queue is full). */
    int (*send)(void *self, const uint8_t *frame, uint32_t length);

    /* Takes the oldest received frame without waiting. Returns its length, 0 if there is no frame,
     * or -errno. *frame points to bytes that stay valid until the next `receive` or `wait_until`. */
    int (*receive)(void *self, const uint8_t **frame);

    /* The link's clock [ns]: CLOCK_MONOTONIC for a NIC, virtual time for a virtual segment. */
    int64_t (*now)(void *self);

    /* Waits until `deadline` [ns, absolute, the link's clock]. With `wake_on_frame` it returns
     * early when a frame can be received. Returns 1 if a frame is available (only with
     * `wake_on_frame`), 0 if the deadline has passed, or -errno. -EINTR: a signal interrupted the
     * wait, and the caller may call again. */
    int (*wait_until)(void *self, int64_t deadline, int wake_on_frame);

    /* Only with CAT_LINK_SPENDS. Lets execution time [ns] pass. Participants of higher priority on
     * the same virtual processor preempt it, so more time may pass. Returns 0, or -errno as above:
     * after -EINTR, call again to continue. */
    int (*spend)(void *self, int64_t duration);

    /* Only with CAT_LINK_FORETELLS (segments in this process). Returns the arrival time of the
     * next frame [ns]; INT64_MAX if there is none. */
    int64_t (*due)(void *self);

    /* File descriptor for poll(), only with CAT_LINK_POLLS. */
    int fd;
} cat_link;

/* Replace the functions of a table. A thread may still be inside an old function, so the owner must
 * keep everything valid that this function uses. */
static inline void cat_link_replace_calls(
        cat_link *link,
        int (*send)(void *, const uint8_t *, uint32_t),
        int (*receive)(void *, const uint8_t **),
        int64_t (*now)(void *),
        int (*wait_until)(void *, int64_t, int)) {
    __atomic_store_n(&link->send, send, __ATOMIC_RELEASE);
    __atomic_store_n(&link->receive, receive, __ATOMIC_RELEASE);
    __atomic_store_n(&link->now, now, __ATOMIC_RELEASE);
    __atomic_store_n(&link->wait_until, wait_until, __ATOMIC_RELEASE);
}

#endif
