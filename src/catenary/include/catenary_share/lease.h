/* Leases: the right to command axes for a limited time (share/lease.py). */
#ifndef CATENARY_SHARE_LEASE_H
#define CATENARY_SHARE_LEASE_H

#include "desk.h"

enum cat_reason { CAT_RELEASED = 1, CAT_EXPIRED = 2, CAT_DIED = 3, CAT_LOOP_ENDED = 4 };

struct catenary_lease {
    catenary_share *share;
    uint32_t *axes;                   /* numbers */
    uint32_t count;
    uint32_t place;
    uint64_t serial;
    int64_t duration_ns;
    int64_t pid;                      /* a forked child does not own the lease */
    cat_desk_row *row;
    uint64_t *requests;               /* the last request of each axis; 0: none */
};

static const char *cat_reason_text(uint64_t reason) {
    static const char *const texts[] = {
        "released", "not renewed in time", "the client process has died", "the loop has ended"};
    return reason >= CAT_RELEASED && reason <= CAT_LOOP_ENDED ? texts[reason - 1] : texts[CAT_EXPIRED - 1];
}

static int cat_is_valid(const catenary_share *share, uint32_t place, uint64_t serial) {
    cat_desk_place *entry = &cat_desk_places(share)[place];
    cat_fence();
    return cat_load_acquire64(&entry->lease) == serial && cat_load_acquire64(&entry->ended) != serial
        && !cat_load_acquire64(cat_desk_closed(share));
}

static uint64_t cat_reason_of(const catenary_share *share, uint32_t place, uint64_t serial) {
    cat_desk_place *entry = &cat_desk_places(share)[place];
    if (cat_load_acquire64(cat_desk_closed(share))) return CAT_LOOP_ENDED;
    if (serial == cat_load_acquire64(&entry->ended) || serial == entry->last) return entry->reason;
    return CAT_EXPIRED;
}

/* Free a place and its axes. The caller holds the mutex. */
static void cat_free_place(const catenary_share *share, uint32_t place, uint64_t reason) {
    cat_desk_place *entry = &cat_desk_places(share)[place];
    uint64_t *holders = cat_desk_holders(share), serial = cat_load_acquire64(&entry->lease);
    uint32_t axis;
    entry->reason = reason;
    entry->last = serial;
    cat_store_release64(&entry->lease, 0);  /* before the holders: the loop reads the lease after them */
    cat_fence();
    for (axis = 0; axis < share->axis_count; axis++) {
        if (holders[axis] == serial) holders[axis] = 0;
    }
}

/* Free the place of a lease that is over. The caller holds the mutex. */
static void cat_free_if_over(const catenary_share *share, uint32_t place, int64_t now) {
    cat_desk_place *entry = &cat_desk_places(share)[place];
    uint64_t serial = cat_load_acquire64(&entry->lease);
    if (!serial) return;
    if (!cat_is_valid(share, place, serial)) cat_free_place(share, place, cat_reason_of(share, place, serial));
    else if (!cat_is_alive(entry->pid, entry->start_time, share->writer.boot_id)) {
        cat_free_place(share, place, CAT_DIED);
    } else if (cat_load_acquire64(&entry->deadline_ns) <= (uint64_t)now) cat_free_place(share, place, CAT_EXPIRED);
}

/* Return the place of a lease; CAT_DESK_PLACES if no place has it. Serial 0 finds a free place. */
static uint32_t cat_place_of(const catenary_share *share, uint64_t serial) {
    uint32_t place;
    for (place = 0; place < CAT_DESK_PLACES; place++) {
        if (cat_load_acquire64(&cat_desk_places(share)[place].lease) == serial) break;
    }
    return place;
}

/* Free what has ended, and axes of a client that was killed while it took them. */
static void cat_clean(const catenary_share *share) {
    uint64_t *holders = cat_desk_holders(share);
    uint32_t k;
    for (k = 0; k < CAT_DESK_PLACES; k++) cat_free_if_over(share, k, cat_now_ns());
    for (k = 0; k < share->axis_count; k++) {
        if (holders[k] && cat_place_of(share, holders[k]) == CAT_DESK_PLACES) holders[k] = 0;
    }
}

static int cat_refuse_leased(const catenary_lease *lease, catenary_error *error) {
    const catenary_share *share = lease->share;
    uint32_t k;
    for (k = 0; k < lease->count; k++) {
        uint64_t holder = cat_desk_holders(share)[lease->axes[k]];
        const cat_desk_place *entry;
        int64_t left;
        if (!holder) continue;
        entry = &cat_desk_places(share)[cat_place_of(share, holder)];
        left = (int64_t)cat_load_acquire64(&entry->deadline_ns) - cat_now_ns();
        return cat_fail(error, CATENARY_E_LEASED, "axis '%s' is leased to process %lld (%.64s) for another %.3f s",
                        share->axes[lease->axes[k]], (long long)entry->pid, entry->command,
                        left > 0 ? (double)left * 1e-9 : 0.0);
    }
    return 0;
}

static uint64_t cat_next_serial(const catenary_share *share) {
    uint64_t newest = 0;
    uint32_t place;
    for (place = 0; place < CAT_DESK_PLACES; place++) {
        const cat_desk_place *entry = &cat_desk_places(share)[place];
        uint64_t serial = cat_load_acquire64(&entry->lease);
        if (serial > newest) newest = serial;
        if (entry->last > newest) newest = entry->last;
    }
    return newest + 1;
}

/* Take a place and the axes. The caller holds the mutex. */
static int cat_take(catenary_lease *lease, const cat_this_process *me, catenary_error *error) {
    catenary_share *share = lease->share;
    cat_desk_place *entry;
    uint32_t k;
    int code;
    cat_clean(share);
    lease->place = cat_place_of(share, 0);
    if (lease->place == CAT_DESK_PLACES) {
        return cat_fail(error, CATENARY_E_FULL, "the share '%s' already has %d clients with a lease", share->name,
                        CAT_DESK_PLACES);
    }
    code = cat_refuse_leased(lease, error);
    if (code) return code;
    lease->serial = cat_next_serial(share);
    entry = &cat_desk_places(share)[lease->place];
    entry->pid = me->pid;
    entry->start_time = me->start_time;
    memcpy(entry->command, me->command, sizeof entry->command);
    for (k = 0; k < lease->count; k++) cat_desk_holders(share)[lease->axes[k]] = lease->serial;
    cat_store_release64(&entry->deadline_ns, (uint64_t)(cat_now_ns() + lease->duration_ns));
    cat_store_release64(&entry->lease, lease->serial);  /* publishes the complete lease to the loop */
    return 0;
}

static int cat_check_axes(const catenary_share *share, const uint32_t *axes, uint32_t count, catenary_error *error) {
    uint32_t k, m;
    for (k = 0; axes && k < count; k++) {
        if (axes[k] >= share->axis_count) {
            return cat_fail(error, CATENARY_E_ARGUMENT, "the share '%s' has no axis %u; it has %u axes", share->name,
                            axes[k], share->axis_count);
        }
        for (m = 0; m < k; m++) {
            if (axes[m] == axes[k]) return cat_fail(error, CATENARY_E_ARGUMENT, "axis %u is given twice", axes[k]);
        }
    }
    if ((axes ? count : share->axis_count) > 0) return 0;
    return cat_fail(error, CATENARY_E_ARGUMENT, "a lease needs at least one axis");
}

static void cat_free_lease(catenary_lease *lease) {
    if (!lease) return;
    free(lease->axes);
    free(lease->row);
    free(lease->requests);
    free(lease);
}

/* Allocate a lease, without taking it. Return NULL if the memory is full. */
static catenary_lease *cat_make_lease(catenary_share *share, const uint32_t *axes, uint32_t count, double duration) {
    catenary_lease *lease = (catenary_lease *)calloc(1, sizeof *lease);
    uint32_t k;
    if (!lease) return NULL;
    lease->share = share;
    lease->count = axes ? count : share->axis_count;
    lease->duration_ns = (int64_t)(duration * 1e9);
    lease->axes = (uint32_t *)calloc(lease->count, sizeof *lease->axes);
    lease->row = (cat_desk_row *)calloc(1, cat_desk_row_size(share->axis_count));
    lease->requests = (uint64_t *)calloc(lease->count, sizeof *lease->requests);
    if (!lease->axes || !lease->row || !lease->requests) {
        cat_free_lease(lease);
        return NULL;
    }
    for (k = 0; k < lease->count; k++) lease->axes[k] = axes ? axes[k] : k;
    return lease;
}

static int cat_lock_and_take(catenary_lease *lease, catenary_error *error) {
    cat_this_process me = cat_identify();
    int code = cat_lock(lease->share, error);
    if (code) return code;
    lease->pid = me.pid;
    code = cat_take(lease, &me, error);
    cat_unlock(lease->share);
    return code;
}

int catenary_lease_take(catenary_share *share, const uint32_t *axes, uint32_t count, double duration,
                        catenary_lease **lease, catenary_error *error) {
    int code;
    if (!share || !lease) return cat_fail(error, CATENARY_E_ARGUMENT, "share or lease is NULL");
    *lease = NULL;
    if (!(duration > 0.0) || duration > 3600.0) {
        return cat_fail(error, CATENARY_E_ARGUMENT, "the duration must be positive and at most 3600 s");
    }
    code = cat_check_axes(share, axes, count, error);
    if (!code) code = cat_check_running(share, error);
    if (!code) code = cat_open_desk(share, error);
    if (code) return code;
    *lease = cat_make_lease(share, axes, count, duration);
    if (!*lease) return cat_fail(error, CATENARY_E_MEMORY, "out of memory");
    code = cat_lock_and_take(*lease, error);
    if (code) {
        cat_free_lease(*lease);
        *lease = NULL;
    }
    return code;
}

/* Renew the lease. The caller holds the mutex, which protects the place against reassignment. */
static int cat_renew(const catenary_lease *lease, catenary_error *error) {
    const catenary_share *share = lease->share;
    cat_desk_place *entry = &cat_desk_places(share)[lease->place];
    int64_t now = cat_now_ns();
    if (!cat_is_valid(share, lease->place, lease->serial) || cat_load_acquire64(&entry->deadline_ns) <= (uint64_t)now) {
        return cat_fail(error, CATENARY_E_LEASE_ENDED, "the lease on '%s' has ended: %s", share->axes[lease->axes[0]],
                        cat_reason_text(cat_reason_of(share, lease->place, lease->serial)));
    }
    cat_store_release64(&entry->deadline_ns, (uint64_t)(now + lease->duration_ns));
    cat_fence();
    return 0;
}

int catenary_lease_renew(catenary_lease *lease, catenary_error *error) {
    int code = cat_check_running(lease->share, error);
    if (!code) code = cat_lock(lease->share, error);
    if (code) return code;
    code = cat_renew(lease, error);
    cat_unlock(lease->share);
    return code;
}

/* Return 0 if the loop reads commands. Its process is checked only if commands are waiting. */
static int cat_check_taken(const catenary_lease *lease, const ring_view *ring, catenary_error *error) {
    uint64_t taken = cat_load_acquire64(&cat_desk_places(lease->share)[lease->place].taken);
    uint64_t waiting = ring_newest(ring) - taken;
    int code = waiting ? cat_check_running(lease->share, error) : 0;
    if (code || waiting < CAT_DESK_COMMANDS) return code;
    return cat_fail(error, CATENARY_E_NOT_READ, "the loop has not read the last %d commands; its body must call "
                    "share.apply(drives) or share.commands()", CAT_DESK_COMMANDS);
}

/* Renew the lease and write its row. The caller holds the mutex. */
static int cat_write_row(const catenary_lease *lease, catenary_error *error) {
    ring_view ring = cat_desk_ring(lease->share, lease->place);
    uint64_t number = ring_newest(&ring) + 1;
    int code = cat_renew(lease, error);
    if (!code) code = cat_check_taken(lease, &ring, error);
    if (code) return code;
    cat_copy_to_shared(ring_begin(&ring, number), lease->row, ring.size);
    ring_publish(&ring, number);
    return 0;
}

/* Write one quantity to the row; NULL: no command. Return 1 if all values are finite. */
static int cat_put_values(const catenary_lease *lease, int quantity, const double *values) {
    uint32_t k, axes = lease->share->axis_count;
    double *places = lease->row->values + (size_t)quantity * axes;
    for (k = 0; k < axes; k++) places[k] = NAN;
    for (k = 0; values && k < lease->count; k++) {
        if (!__builtin_isfinite(values[k])) return 0;
        places[lease->axes[k]] = values[k];
    }
    if (values) lease->row->quantities |= 1u << quantity;
    return 1;
}

int catenary_lease_send(catenary_lease *lease, const double *position, const double *velocity, const double *torque,
                        catenary_error *error) {
    int code;
    lease->row->lease = lease->serial;
    lease->row->quantities = 0;
    if (!cat_put_values(lease, 0, position) || !cat_put_values(lease, 1, velocity) || !cat_put_values(lease, 2, torque)) {
        return cat_fail(error, CATENARY_E_ARGUMENT, "a set-point is NaN or infinite");
    }
    if (!lease->row->quantities) {
        return cat_fail(error, CATENARY_E_ARGUMENT, "nothing to send; pass position, velocity or torque");
    }
    code = cat_lock(lease->share, error);
    if (code) return code;
    code = cat_write_row(lease, error);
    cat_unlock(lease->share);
    return code;
}

static cat_motion_slot *cat_slot(const catenary_lease *lease, uint32_t k) {
    return (cat_motion_slot *)(cat_desk_motion(lease->share) + 1) + lease->axes[k];
}

/* Publish a requested state of all axes. The caller holds the mutex. */
static void cat_put_requests(catenary_lease *lease, uint64_t state) {
    uint32_t k;
    if (state == CATENARY_QUICK_STOP) {
        cat_store_release64(&cat_desk_motion(lease->share)->stopper, (uint64_t)getpid());
    }
    for (k = 0; k < lease->count; k++) {
        uint64_t number = (cat_load_acquire64(&cat_slot(lease, k)->request) >> CAT_MOTION_STATUS_BITS) + 1;
        lease->requests[k] = number << CAT_MOTION_STATUS_BITS;
        cat_store_release64(&cat_slot(lease, k)->request, lease->requests[k] | state);
    }
}

int catenary_lease_request(catenary_lease *lease, int state, catenary_error *error) {
    int code;
    if (state < CATENARY_DISABLE || state > CATENARY_RESET) {
        return cat_fail(error, CATENARY_E_ARGUMENT, "%d is not a state of enum catenary_request", state);
    }
    code = cat_check_running(lease->share, error);
    if (!code) code = cat_lock(lease->share, error);
    if (code) return code;
    code = cat_renew(lease, error);
    if (!code) cat_put_requests(lease, (uint64_t)state);
    cat_unlock(lease->share);
    return code;
}

static const char *cat_request_text(uint64_t status) {
    switch (status) {                 /* RequestStatus of share/jog.py */
    case 16: return "the program does not allow it; it must open cat.Share(..., jog=True)";
    case 18: return "the program must enable an axis in this mode";
    case 22: return "the device does not answer";
    case 23: return "the program starts, ends or waits";
    default: return "the requested state is not valid";
    }
}

int catenary_lease_request_status(const catenary_lease *lease, catenary_error *error) {
    int is_complete = 1;
    uint32_t k;
    for (k = 0; k < lease->count; k++) {
        uint64_t answer = cat_load_acquire64(&cat_slot(lease, k)->taken);
        uint64_t status = answer & ((1u << CAT_MOTION_STATUS_BITS) - 1);
        int is_answered = lease->requests[k] && answer - status == lease->requests[k] && status;
        if (is_answered && status != 1) {
            return cat_fail(error, CATENARY_E_REFUSED, "axis '%s' refuses the request: %s",
                            lease->share->axes[lease->axes[k]], cat_request_text(status));
        }
        is_complete &= is_answered;
    }
    return is_complete;
}

int catenary_lease_release(catenary_lease *lease, catenary_error *error) {
    int code = 0;
    if (!lease) return 0;
    if (lease->pid == getpid()) {
        code = cat_lock(lease->share, error);
        if (!code && cat_is_valid(lease->share, lease->place, lease->serial)) {
            cat_free_place(lease->share, lease->place, CAT_RELEASED);
        }
        if (!code) cat_unlock(lease->share);
    }
    cat_free_lease(lease);
    return code;
}

#endif
