/* Desk of a loop: memory for the commands of clients and for their leases (share/command_table.py).
 *
 * The loop sends a descriptor of the memory over a socket (share/desk_socket.py). The memory is sealed, so
 * that no client can resize it. It contains the head, a mutex, the word `closed`, the holders (for each axis
 * the serial of its lease), the places (one for each client), one ring for each place, and the motion
 * words (native/motion.h).
 */
#ifndef CATENARY_SHARE_DESK_H
#define CATENARY_SHARE_DESK_H

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "../../native/motion.h"
#include "../../share/mutex.h"
#include "segment.h"

#define CAT_DESK_MAGIC "CATADESK"

enum {
    CAT_DESK_PLACES = 16,
    CAT_DESK_COMMANDS = 64,           /* maximum number of unread commands of a client */
    CAT_DESK_QUANTITIES = 3,          /* position, velocity, torque */
    CAT_DESK_AXES_MAX = 1 << 16,
    CAT_DESK_PAUSE_MS = 2
};

static const int64_t CAT_DESK_TIMEOUT_NS = 2000000000;

typedef struct cat_desk_head {
    char magic[8];
    uint32_t version;
    uint32_t axes;
    char run[32];
} cat_desk_head;

typedef struct cat_desk_place {
    uint64_t lease;                   /* serial; 0: the place is free. Publishes the client and its axes. */
    uint64_t ended;                   /* the lease that the loop has ended. Publishes the reason. */
    uint64_t taken;                   /* number of commands that the loop has read */
    uint64_t deadline_ns;             /* CLOCK_MONOTONIC */
    uint64_t last;                    /* the previous lease */
    uint64_t reason;                  /* why the previous lease ended */
    uint64_t start_time;              /* of the client process */
    int64_t pid;
    char command[64];
} cat_desk_place;

typedef struct cat_desk_row {
    uint64_t lease;
    uint64_t quantities;              /* bit 0: position, 1: velocity, 2: torque */
    double values[];                  /* [quantity * axes + axis]; NaN: no command */
} cat_desk_row;

/* Offsets of the parts, and sizes [bytes]. */
typedef struct cat_desk_parts {
    uint64_t mutex, closed, holders, places, rings, ring_size, motion, size;
} cat_desk_parts;

static uint64_t cat_aligned(uint64_t offset) { return (offset + 63) / 64 * 64; }

static size_t cat_desk_row_size(uint32_t axes) {
    return sizeof(cat_desk_row) + CAT_DESK_QUANTITIES * sizeof(double) * (size_t)axes;
}

static cat_desk_parts cat_desk_parts_of(uint32_t axes) {
    cat_desk_parts parts;
    uint64_t slots = axes ? axes : 1;  /* a loop without axes has an unused slot */
    parts.mutex = cat_aligned(sizeof(cat_desk_head));
    parts.closed = parts.mutex + cat_aligned(sizeof(share_mutex));
    parts.holders = cat_aligned(parts.closed + sizeof(uint64_t));
    parts.places = cat_aligned(parts.holders + sizeof(uint64_t) * axes);
    parts.rings = cat_aligned(parts.places + CAT_DESK_PLACES * sizeof(cat_desk_place));
    parts.ring_size = cat_aligned(sizeof(share_ring) + CAT_DESK_COMMANDS * ring_stride(cat_desk_row_size(axes)));
    parts.motion = parts.rings + CAT_DESK_PLACES * parts.ring_size;
    parts.size = parts.motion + sizeof(cat_motion) + slots * sizeof(cat_motion_slot);
    return parts;
}

static share_mutex *cat_desk_mutex(const catenary_share *share) {
    return (share_mutex *)(share->desk + cat_desk_parts_of(share->axis_count).mutex);
}

static uint64_t *cat_desk_closed(const catenary_share *share) {
    return (uint64_t *)(share->desk + cat_desk_parts_of(share->axis_count).closed);
}

static uint64_t *cat_desk_holders(const catenary_share *share) {
    return (uint64_t *)(share->desk + cat_desk_parts_of(share->axis_count).holders);
}

static cat_desk_place *cat_desk_places(const catenary_share *share) {
    return (cat_desk_place *)(share->desk + cat_desk_parts_of(share->axis_count).places);
}

static cat_motion *cat_desk_motion(const catenary_share *share) {
    return (cat_motion *)(share->desk + cat_desk_parts_of(share->axis_count).motion);
}

static ring_view cat_desk_ring(const catenary_share *share, uint32_t place) {
    cat_desk_parts parts = cat_desk_parts_of(share->axis_count);
    ring_view view;
    view.ring = (share_ring *)(share->desk + parts.rings + place * parts.ring_size);
    view.count = CAT_DESK_COMMANDS;
    view.size = cat_desk_row_size(share->axis_count);
    view.stride = ring_stride(view.size);
    return view;
}

/* Connect to the socket. Retry while its queue is full: the kernel then returns EAGAIN. */
static int cat_connect(int connection, const char *path) {
    int64_t deadline = cat_now_ns() + CAT_DESK_TIMEOUT_NS;
    struct sockaddr_un address;
    memset(&address, 0, sizeof address);
    address.sun_family = AF_UNIX;
    if (strlen(path) >= sizeof address.sun_path) return ENAMETOOLONG;
    memcpy(address.sun_path, path, strlen(path));
    for (;;) {
        if (connect(connection, (struct sockaddr *)&address, sizeof address) == 0) return 0;
        if (errno != EAGAIN || cat_now_ns() >= deadline) return errno;
        poll(NULL, 0, CAT_DESK_PAUSE_MS);
    }
}

/* Receive a descriptor, unix(7). Return it, or -errno. */
static int cat_receive_descriptor(int connection) {
    char answer[8];
    union { char bytes[CMSG_SPACE(sizeof(int))]; struct cmsghdr align; } control;
    struct iovec part;
    struct msghdr message;
    struct cmsghdr *header;
    struct pollfd ready;
    int descriptor;
    ready.fd = connection;
    ready.events = POLLIN;
    if (poll(&ready, 1, (int)(CAT_DESK_TIMEOUT_NS / 1000000)) != 1) return -ETIMEDOUT;
    part.iov_base = answer;
    part.iov_len = sizeof answer;
    memset(&message, 0, sizeof message);
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.bytes;
    message.msg_controllen = sizeof control.bytes;
    if (recvmsg(connection, &message, MSG_CMSG_CLOEXEC) < 0) return -errno;
    header = CMSG_FIRSTHDR(&message);
    if (!header || header->cmsg_level != SOL_SOCKET || header->cmsg_type != SCM_RIGHTS) return -EPROTO;
    memcpy(&descriptor, CMSG_DATA(header), sizeof descriptor);
    return descriptor;
}

/* Request the descriptor of the desk from a socket. The server must belong to `owner`. Return it, or
 * -errno. */
static int cat_request_descriptor(int connection, const char *path, uid_t owner) {
    struct ucred peer;
    socklen_t length = sizeof peer;
    int rc = cat_connect(connection, path);
    if (rc) return -rc;
    if (getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &length) != 0) return -errno;
    return peer.uid == owner ? cat_receive_descriptor(connection) : -EPERM;
}

static int cat_desk_error(const catenary_share *share, int rc, catenary_error *error) {
    if (rc == -ENOENT) {
        return cat_fail(error, CATENARY_E_NO_COMMANDS, "the share '%s' does not accept commands", share->name);
    }
    if (rc == -EACCES) {
        return cat_fail(error, CATENARY_E_PERMISSION, "no permission to command the share '%s'; its writer can allow "
                        "it: cat.Share(..., mode=0o660) for the group", share->name);
    }
    return cat_fail(error, CATENARY_E_NO_COMMANDS, "%s does not answer: %s", share->socket, strerror(-rc));
}

/* Map sealed memory, and close the descriptor. */
static int cat_map_desk(catenary_share *share, int descriptor, catenary_error *error) {
    const int seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;
    uint64_t size = cat_desk_parts_of(share->axis_count).size;
    struct stat status;
    void *memory = MAP_FAILED;
    int found = fcntl(descriptor, F_GET_SEALS);  /* fails for other kinds of files */
    int is_valid = found >= 0 && (found & seals) == seals && fstat(descriptor, &status) == 0
        && (uint64_t)status.st_size == size;
    if (is_valid) memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, descriptor, 0);
    close(descriptor);
    if (!is_valid) return cat_fail(error, CATENARY_E_DAMAGED, "the memory for commands has the wrong size or seals");
    if (memory == MAP_FAILED) {
        return cat_fail(error, CATENARY_E_SYSTEM, "cannot map the memory for commands: %s", strerror(errno));
    }
    share->desk = (uint8_t *)memory;
    return 0;
}

static void cat_unmap_desk(catenary_share *share) {
    if (share->desk) munmap(share->desk, cat_desk_parts_of(share->axis_count).size);
    share->desk = NULL;
}

static int cat_check_desk(catenary_share *share, catenary_error *error) {
    cat_desk_head head;
    memcpy(&head, share->desk, sizeof head);
    if (memcmp(head.magic, CAT_DESK_MAGIC, sizeof head.magic) != 0 || head.version != CAT_SHARE_VERSION
        || head.axes != share->axis_count || memcmp(head.run, share->run, sizeof head.run) != 0) {
        return cat_fail(error, CATENARY_E_ENDED, "the share '%s' now belongs to another loop; open it again",
                        share->name);
    }
    if (mutex_is_ours(cat_desk_mutex(share))) return 0;
    return cat_fail(error, CATENARY_E_DAMAGED, "the desk of the share '%s' is damaged", share->name);
}

/* Open the desk, unless it is open already. */
static int cat_open_desk(catenary_share *share, catenary_error *error) {
    int connection, rc, code;
    if (share->desk) return 0;
    if (share->axis_count > CAT_DESK_AXES_MAX) return cat_fail(error, CATENARY_E_DAMAGED, "too many axes");
    connection = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (connection < 0) return cat_fail(error, CATENARY_E_SYSTEM, "cannot create a socket: %s", strerror(errno));
    rc = cat_request_descriptor(connection, share->socket, share->owner);
    close(connection);
    if (rc < 0) return cat_desk_error(share, rc, error);
    code = cat_map_desk(share, rc, error);
    if (code) return code;
    code = cat_check_desk(share, error);
    if (code) cat_unmap_desk(share);
    return code;
}

static int cat_lock(const catenary_share *share, catenary_error *error) {
    int rc = mutex_lock(cat_desk_mutex(share), CAT_DESK_TIMEOUT_NS);
    if (rc >= 0) return 0;            /* 1: the previous owner has died; every change is valid on its own */
    if (rc == -ETIMEDOUT) {
        return cat_fail(error, CATENARY_E_LOCKED, "another client has locked the desk for 2 s; a debugger or SIGSTOP may "
                        "have stopped that client");
    }
    return cat_fail(error, CATENARY_E_DAMAGED, "the mutex of the desk is damaged: %s", strerror(-rc));
}

static void cat_unlock(const catenary_share *share) { mutex_unlock(cat_desk_mutex(share)); }

int catenary_stop(catenary_share *share, catenary_error *error) {
    cat_motion *motion;
    int code = cat_open_desk(share, error);
    if (code) return code;
    motion = cat_desk_motion(share);
    cat_store_release64(&motion->stopper, (uint64_t)getpid());
    cat_add64(&motion->stop, 1);
    return cat_check_running(share, error);
}

void catenary_close(catenary_share *share) {
    if (!share) return;
    cat_unmap_desk(share);
    if (share->memory) munmap(share->memory, share->size);
    free((void *)share->axes);
    free(share->fields);
    free(share->text);
    free(share);
}

#endif
