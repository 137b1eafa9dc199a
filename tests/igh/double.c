/* Test double of libethercat with n working CiA 402 drives. All calls are recorded in order.
 *
 * In a build with void functions, these leave -5 (-EIO) in the return register, which must not be
 * read. Tests control the double by the double_* functions at the end.
 */
#include "double.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#pragma GCC diagnostic ignored "-Wreturn-type"
#pragma GCC visibility push(default)

enum { SLAVES = 64, OBJECTS = 40, PDO_ENTRIES = 16, DOMAINS = 64, CLIMB = 3, ANSWER_AFTER = 2 };
enum { PREOP = 2, SAFEOP = 4, OP = 8 };

#if defined(RETURNS_VOID) && defined(__x86_64__)  /* value left in the return register */
#define DONE(value) do { register long garbage __asm__("rax") = -EIO; \
                         __asm__ volatile("" : "+r"(garbage)); (void)(value); return; } while (0)
#elif defined(RETURNS_VOID)
#define DONE(value) do { (void)(value); return; } while (0)
#else
#define DONE(value) return (value)
#endif

typedef struct { uint16_t index; uint8_t subindex, bits; uint64_t value; } object;
typedef struct { uint16_t pdo; int count; ec_pdo_entry_info_t entries[PDO_ENTRIES]; } pdo_map;

typedef struct {
    object objects[OBJECTS];
    int count;
    pdo_map maps[2];              /* SyncManager 2 and 3 */
    uint8_t registers[0x1000];
    int al, error, online, sends;
    int alias, clockless, plain;  /* plain: no mailbox, its outputs in SyncManager 0 */
    int unacknowledged;           /* sends until the master has acknowledged its error */
    int booting;                  /* reads until the master has brought it to PRE-OP */
    int staying;                  /* reads after a deactivation until it leaves OP */
    uint8_t emergencies[16][8];
    int first_emergency, last_emergency;
} slave;

struct double_domain {
    uint8_t data[8192];
    uint8_t input_copy[8192];
    size_t size;
    int queued, arrived, expected, counter, early;
};

struct double_config {
    int position, used, wrong, alias, steps;
    struct { int registered, offset, domain; } syncs[2];
    size_t emergencies;
};

struct double_sdo { int position, state, pending; uint16_t index; uint8_t subindex;
                    size_t size, room; uint8_t *data; };
struct double_register { int position, state, pending, write; uint16_t address; size_t size;
                         uint8_t *data; };

struct double_master {
    struct double_domain domains[DOMAINS];
    struct double_config configs[SLAVES];
    struct double_sdo sdos[4 * SLAVES];
    struct double_register registers[SLAVES];
    int domain_count, config_count, sdo_count, register_count, active, monitoring, monitored;
    uint64_t app_time;
};

static struct {
    int slaves, reserved, absent, redundancy, scanning, cable;
    uint32_t spread;              /* OR of all 0x092C */
    int silent;                   /* uploads that get no answer */
    int64_t delay, sent;          /* [ns] from send to the frames' return */
    int early;                    /* domains processed before their frames were back */
    int climb;                    /* sends from one state to the next */
    int lingering;                /* `staying` of all devices when the master is deactivated */
    uint32_t refusal;             /* abort code of downloads to 0x1C32 */
    uint32_t delay_to_next;       /* measured delay of every device [ns] */
    int mainless;                 /* answers return on the backup interface: no monitor datagram */
    int closed_ring;              /* the last device's second port leads to a backup interface */
    volatile int blocked;         /* position whose objects do not answer, plus one */
    uint64_t reference;           /* reference time in the last frame; 0: the application time */
    slave all[SLAVES];
    char *record;
    size_t length, room;
    int recording;
    char fail[64];
    int fail_with;
} bus = {.recording = 1, .cable = 1};
static struct double_master *the_master;

static void note(const char *format, ...) __attribute__((format(printf, 1, 2)));
#include <stdarg.h>
static void note(const char *format, ...)
{
    va_list values;
    if (!bus.recording)
        return;
    if (bus.room < bus.length + 256) {
        bus.room = 2 * bus.room + 4096;
        bus.record = realloc(bus.record, bus.room);
    }
    va_start(values, format);
    bus.length += vsnprintf(bus.record + bus.length, 200, format, values);
    va_end(values);
    bus.record[bus.length++] = '\n';
    bus.record[bus.length] = 0;
}

static int failure(const char *name)
{
    return strcmp(bus.fail, name) == 0 ? bus.fail_with : 0;
}

static int64_t monotonic(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void pause_a_little(void)
{
    struct timespec nap = {0, 1000000};
    nanosleep(&nap, NULL);
}

/* Objects and drives */

static object *find(slave *s, uint16_t index, uint8_t subindex)
{
    for (int k = 0; k < s->count; k++)
        if (s->objects[k].index == index && s->objects[k].subindex == subindex)
            return &s->objects[k];
    return NULL;
}

static void add(slave *s, uint16_t index, uint8_t subindex, uint8_t bits, uint64_t value)
{
    s->objects[s->count++] = (object){index, subindex, bits, value};
}

static uint64_t value_of(slave *s, uint16_t index) { return find(s, index, 0)->value; }
static void set(slave *s, uint16_t index, uint64_t value) { find(s, index, 0)->value = value; }

static void make_drive(slave *s, int position)
{
    memset(s, 0, sizeof *s);
    s->al = PREOP;
    s->online = 1;
    s->alias = position == 1 ? 7 : 0;
    add(s, 0x1000, 0, 32, 0x00020192);
    add(s, 0x1018, 1, 32, 0x000000AA);
    add(s, 0x1C32, 1, 16, 1);
    add(s, 0x1C32, 2, 32, 0);
    add(s, 0x1C32, 0x0B, 16, 0);
    add(s, 0x603F, 0, 16, 0);
    add(s, 0x6040, 0, 16, 0);
    add(s, 0x6041, 0, 16, 0x0240);
    add(s, 0x605A, 0, 16, 2);
    add(s, 0x6060, 0, 8, 0);
    add(s, 0x6061, 0, 8, 0);
    add(s, 0x6064, 0, 32, (uint64_t)(uint32_t)(1000 * position));
    add(s, 0x606C, 0, 32, 0);
    add(s, 0x6071, 0, 16, 0);
    add(s, 0x6076, 0, 32, 1000);
    add(s, 0x6077, 0, 16, 0);
    add(s, 0x607A, 0, 32, 0);
    add(s, 0x60C2, 1, 8, 1);
    add(s, 0x60C2, 2, 8, 0xFD);
    add(s, 0x60FF, 0, 32, 0);
    s->maps[0] = (pdo_map){0x1600, 3, {{0x6040, 0, 16}, {0x607A, 0, 32}, {0x6060, 0, 8}}};
    s->maps[1] = (pdo_map){0x1A00, 4,
                           {{0x6041, 0, 16}, {0x6064, 0, 32}, {0x6077, 0, 16}, {0x6061, 0, 8}}};
}

static uint16_t next_word(uint16_t word, uint16_t control)
{
    switch (word & 0x6F) {
    case 0x40: return (control & 0x87) == 0x06 ? 0x0221 : word;
    case 0x21: return (control & 0x87) == 0x07 ? 0x0233 : (control & 0x82) == 0 ? 0x0240 : word;
    case 0x23: return (control & 0x8F) == 0x0F ? 0x1237
                    : (control & 0x87) == 0x06 ? 0x0221 : (control & 0x82) == 0 ? 0x0240 : word;
    case 0x27: return (control & 0x86) == 0x02 ? 0x0207 : (control & 0x8F) == 0x07 ? 0x0233
                    : (control & 0x87) == 0x06 ? 0x0221 : (control & 0x82) == 0 ? 0x0240 : word;
    case 0x07: return (control & 0x82) == 0 ? 0x0240 : word;
    default: return control & 0x80 ? 0x0240 : word;
    }
}

static void step_drive(slave *s)
{
    uint16_t before = value_of(s, 0x6041), word = next_word(before, value_of(s, 0x6040));
    set(s, 0x6041, word);
    set(s, 0x6061, value_of(s, 0x6060));
    if ((word & 0x6F) == 0x27 && (int8_t)value_of(s, 0x6061) == 8)
        set(s, 0x6064, value_of(s, 0x607A));
    if ((word & 0x6F) == 0x27 && (int8_t)value_of(s, 0x6061) == 10)
        set(s, 0x6077, value_of(s, 0x6071));
}

static int bits_of(const pdo_map *map)
{
    int bits = 0;
    for (int k = 0; k < map->count; k++)
        bits += map->entries[k].bit_length;
    return bits;
}

static void move(slave *s, const pdo_map *map, uint8_t *bytes, int to_bytes)
{
    int bit = 0;
    for (int k = 0; k < map->count; k++) {
        object *o = find(s, map->entries[k].index, map->entries[k].subindex);
        uint64_t value = 0;
        for (int b = 0; b < map->entries[k].bit_length; b++, bit++) {
            if (to_bytes && o) {
                bytes[bit / 8] &= ~(1 << (bit % 8));
                bytes[bit / 8] |= (o->value >> b & 1) << (bit % 8);
            } else {
                value |= (uint64_t)(bytes[bit / 8] >> (bit % 8) & 1) << b;
            }
        }
        if (!to_bytes && o)
            o->value = value;
    }
}

/* Master */

unsigned int ecrt_version_magic(void) { return VERSION_MAGIC; }

ec_master_t *ecrt_request_master(unsigned int index)
{
    note("request_master %u", index);
    if (bus.absent || bus.reserved) {
        errno = bus.absent ? bus.absent : EBUSY;
        return NULL;
    }
    bus.reserved = 1;
    the_master = calloc(1, sizeof *the_master);
    return the_master;
}

void ecrt_release_master(ec_master_t *m)
{
    note("release_master");
    for (int k = 0; k < bus.slaves; k++)
        bus.all[k].al = PREOP;
    bus.reserved = 0;
    the_master = NULL;
    free(m);
}

static void clear(ec_master_t *m)
{
    for (int k = 0; k < m->sdo_count; k++)
        free(m->sdos[k].data);
    for (int k = 0; k < m->register_count; k++)
        free(m->registers[k].data);
    memset(m, 0, sizeof *m);
}

ec_domain_t *ecrt_master_create_domain(ec_master_t *m)
{
    note("create_domain");
    if (failure("create_domain") || m->active)
        return NULL;
    return &m->domains[m->domain_count++];
}

static void find_slave(ec_slave_config_t *c)
{
    c->position = c->steps;
    if (c->alias) {
        for (c->position = 0; c->position < bus.slaves; c->position++)
            if (bus.all[c->position].alias == c->alias)
                break;
        c->position += c->steps;
    }
    if (c->position >= bus.slaves) {
        c->position = 0;
        c->wrong = 1;
    }
}

ec_slave_config_t *ecrt_master_slave_config(ec_master_t *m, uint16_t alias, uint16_t position,
                                            uint32_t vendor, uint32_t product)
{
    ec_slave_config_t *c = &m->configs[m->config_count++];
    note("slave_config %u %u %x %x", alias, position, vendor, product);
    if (failure("slave_config") || m->active)
        return NULL;
    *c = (ec_slave_config_t){.used = 1, .alias = alias, .steps = position};
    c->wrong = vendor != 0xAA || product != 0x402;
    find_slave(c);
    return c;
}

int ecrt_master_select_reference_clock(ec_master_t *m, ec_slave_config_t *c)
{
    (void)m;
    note("select_reference_clock %d", c ? c->position : -1);
    return 0;
}

int ecrt_master(ec_master_t *m, ec_master_info_t *info)
{
    note("master");
    info->slave_count = bus.slaves;
    info->link_up = bus.cable;
    info->scan_busy = bus.scanning > 0 ? bus.scanning-- > 0 : 0;
    info->app_time = m->app_time;
    return failure("master");
}

int ecrt_master_get_slave(ec_master_t *m, uint16_t position, ec_slave_info_t *info)
{
    (void)m;
    note("get_slave %u", position);
    if (position >= bus.slaves)
        return -EINVAL;
    memset(info, 0, sizeof *info);
    info->position = position;
    info->vendor_id = 0xAA;
    info->product_code = 0x402;
    info->revision_number = 1;
    info->serial_number = 100 + position;
    info->alias = bus.all[position].alias;
    if (bus.all[position].booting && --bus.all[position].booting == 0)
        bus.all[position].al = PREOP;
    if (bus.all[position].staying && --bus.all[position].staying == 0)
        bus.all[position].al = PREOP;
    info->al_state = bus.all[position].al;
    info->error_flag = bus.all[position].error;
    info->sync_count = bus.all[position].plain ? 1 : 4;
    info->sdo_count = bus.all[position].count;
    for (int k = 0; k < 2 && !bus.all[position].clockless; k++)
        info->ports[k].receive_time = 1000 + k;
    info->ports[0].link.link_up = 1;
    info->ports[1].link.link_up = position + 1 < bus.slaves || bus.closed_ring;
    for (int k = 0; k < EC_MAX_PORTS; k++)
        info->ports[k].link.loop_closed = !info->ports[k].link.link_up;
    info->ports[0].delay_to_next_dc = bus.delay_to_next;
    strcpy(info->name, "Doubled Drive");
    return 0;
}

int ecrt_master_get_sync_manager(ec_master_t *m, uint16_t position, uint8_t sync,
                                 ec_sync_info_t *info)
{
    (void)m;
    if (position >= bus.slaves || sync >= 4)
        return -EINVAL;
    *info = (ec_sync_info_t){.index = sync, .dir = sync & 1 ? EC_DIR_INPUT : EC_DIR_OUTPUT,
                             .n_pdos = sync >= 2 || bus.all[position].plain};
    return 0;
}

int ecrt_master_get_pdo(ec_master_t *m, uint16_t position, uint8_t sync, uint16_t rank,
                        ec_pdo_info_t *info)
{
    (void)m;
    if (position < bus.slaves && bus.all[position].plain && sync == 0)
        sync = 2;
    if (position >= bus.slaves || sync < 2 || sync > 3 || rank)
        return -EINVAL;
    *info = (ec_pdo_info_t){.index = bus.all[position].maps[sync - 2].pdo,
                            .n_entries = bus.all[position].maps[sync - 2].count};
    return 0;
}

int ecrt_master_get_pdo_entry(ec_master_t *m, uint16_t position, uint8_t sync, uint16_t pdo,
                              uint16_t rank, ec_pdo_entry_info_t *info)
{
    (void)m;
    if (position < bus.slaves && bus.all[position].plain && sync == 0)
        sync = 2;
    if (position >= bus.slaves || sync < 2 || sync > 3 || pdo)
        return -EINVAL;
    if (rank >= bus.all[position].maps[sync - 2].count)
        return -EINVAL;
    *info = bus.all[position].maps[sync - 2].entries[rank];
    return 0;
}

static int upload(int position, uint16_t index, uint8_t subindex, uint8_t *target, size_t room,
                  size_t *result, uint32_t *abort_code)
{
    object *o = position < bus.slaves ? find(&bus.all[position], index, subindex) : NULL;
    *abort_code = 0;
    if (position >= bus.slaves)
        return -EINVAL;
    if (bus.all[position].plain)
        return -EPROTONOSUPPORT;
    if (bus.silent > 0 && bus.silent--)
        return -EIO;
    if (bus.all[position].al < PREOP)  /* in INIT, devices do not answer */
        return -EIO;
    if (o == NULL) {
        *abort_code = 0x06020000;
        return -EIO;
    }
    *result = (o->bits + 7) / 8;
    if (*result > room)
        return -EOVERFLOW;
    memcpy(target, &o->value, *result);
    return 0;
}

int ecrt_master_sdo_upload(ec_master_t *m, uint16_t position, uint16_t index, uint8_t subindex,
                           uint8_t *target, size_t size, size_t *result, uint32_t *abort_code)
{
    (void)m;
    note("sdo_upload %u %04x:%02x", position, index, subindex);
    while (bus.blocked == position + 1)
        pause_a_little();
    return upload(position, index, subindex, target, size, result, abort_code);
}

int ecrt_master_sdo_download(ec_master_t *m, uint16_t position, uint16_t index, uint8_t subindex,
                             const uint8_t *data, size_t size, uint32_t *abort_code)
{
    object *o = position < bus.slaves ? find(&bus.all[position], index, subindex) : NULL;
    (void)m;
    note("sdo_download %u %04x:%02x %zu", position, index, subindex, size);
    while (bus.blocked == position + 1)
        pause_a_little();
    *abort_code = 0;
    if (o != NULL && index == 0x1C32 && (bus.refusal || bus.all[position].al != PREOP)) {
        *abort_code = bus.refusal ? bus.refusal : 0x08000022;  /* cannot be transferred in this state */
        return -EIO;
    }
    if (o == NULL || size != (size_t)(o->bits + 7) / 8) {
        *abort_code = o == NULL ? 0x06020000 : 0x06070010;
        return -EIO;
    }
    o->value = 0;
    memcpy(&o->value, data, size);
    return 0;
}

int ecrt_master_sdo_download_complete(ec_master_t *m, uint16_t position, uint16_t index,
                                      const uint8_t *data, size_t size, uint32_t *abort_code)
{
    return ecrt_master_sdo_download(m, position, index, 0, data, size, abort_code);
}

int ecrt_master_activate(ec_master_t *m)
{
    note("activate");
    if (failure("activate"))
        return failure("activate");
    m->active = 1;
    return 0;
}

status ecrt_master_deactivate(ec_master_t *m)
{
    note("deactivate");
    for (int k = 0; k < bus.slaves; k++) {
        if ((bus.all[k].staying = bus.lingering) == 0)  /* the real master brings them down later */
            bus.all[k].al = PREOP;
        bus.all[k].sends = 0;
    }
    clear(m);
    DONE(0);
}

int ecrt_master_set_send_interval(ec_master_t *m, size_t interval)
{
    (void)m;
    note("set_send_interval %zu", interval);
    return 0;
}

static void answer_requests(ec_master_t *m)
{
    for (int k = 0; k < m->sdo_count; k++) {
        ec_sdo_request_t *r = &m->sdos[k];
        uint32_t code;
        if (!bus.all[r->position].online)
            continue;             /* requests of a missing device are not processed */
        if (r->state == EC_REQUEST_BUSY && --r->pending == 0)
            r->state = upload(r->position, r->index, r->subindex, r->data, r->room, &r->size, &code)
                ? EC_REQUEST_ERROR : EC_REQUEST_SUCCESS;
    }
    for (int k = 0; k < m->register_count; k++) {
        ec_reg_request_t *r = &m->registers[k];
        uint8_t *at = bus.all[r->position].registers + r->address % 0x1000;
        if (r->state != EC_REQUEST_BUSY || --r->pending)
            continue;
        if (bus.all[r->position].unacknowledged) {
            r->state = EC_REQUEST_ERROR;
            continue;
        }
        memcpy(r->write ? at : r->data, r->write ? r->data : at, r->size);
        r->state = EC_REQUEST_SUCCESS;
    }
}

static void climb(slave *s, int configured)
{
    if (!configured || !s->online || s->al == OP || s->error)
        return;
    if (++s->sends % (bus.climb ? bus.climb : CLIMB) == 0)
        s->al *= 2;
}

status ecrt_master_send(ec_master_t *m)
{
    note("send");
    bus.sent = monotonic();
    m->monitored = m->monitoring && bus.cable;
    m->monitoring = 0;
    for (int k = 0; k < bus.slaves; k++)
        bus.all[k].unacknowledged -= bus.all[k].unacknowledged > 0;
    for (int k = 0; k < m->domain_count; k++) {
        ec_domain_t *d = &m->domains[k];
        d->counter = 0;
        d->arrived = d->queued && bus.cable;
        d->queued = 0;
    }
    for (int k = 0; k < m->config_count && bus.cable; k++) {
        ec_slave_config_t *c = &m->configs[k];
        slave *s = &bus.all[c->position];
        if (c->wrong)
            continue;
        climb(s, 1);
        for (int way = 0; way < 2; way++) {
            ec_domain_t *d = &m->domains[c->syncs[way].domain];
            if (!c->syncs[way].registered || !d->arrived || !s->online || s->al < SAFEOP)
                continue;
            if (way == 0 && s->al == OP) {
                move(s, &s->maps[0], d->data + c->syncs[0].offset, 0);
                step_drive(s);
                d->counter += 2;
            }
            if (way == 1) {
                move(s, &s->maps[1], d->input_copy + c->syncs[1].offset, 1);
                d->counter += 1;
            }
        }
    }
    answer_requests(m);
    DONE(failure("send"));
}

status ecrt_master_receive(ec_master_t *m)
{
    (void)m;
    note("receive");
    DONE(failure("receive"));
}

status ecrt_master_state(const ec_master_t *m, ec_master_state_t *state)
{
    (void)m;
    note("master_state");
    memset(state, 0, sizeof *state);
    state->link_up = bus.cable;
    for (int k = 0; k < bus.slaves; k++)
        if (bus.all[k].online && bus.cable) {
            state->slaves_responding++;
            state->al_states |= bus.all[k].al;
        }
    DONE(0);
}

int ecrt_master_link_state(const ec_master_t *m, unsigned int device, ec_master_link_state_t *state)
{
    (void)m;
    note("link_state %u", device);
    if (device > (bus.redundancy ? 1U : 0U))
        return -EINVAL;
    memset(state, 0, sizeof *state);
    state->link_up = bus.cable;
    return 0;
}

status ecrt_master_application_time(ec_master_t *m, uint64_t time)
{
    note("application_time %llu", (unsigned long long)time);
    m->app_time = time;
    DONE(0);
}

status ecrt_master_sync_reference_clock(ec_master_t *m)
{
    (void)m;
    note("sync_reference_clock");
    DONE(0);
}

#if RELEASE > 2
status ecrt_master_sync_reference_clock_to(ec_master_t *m, uint64_t time)
{
    (void)m;
    note("sync_reference_clock_to %llu", (unsigned long long)time);
    DONE(0);
}
#endif

status ecrt_master_sync_slave_clocks(ec_master_t *m)
{
    (void)m;
    note("sync_slave_clocks");
    DONE(0);
}

int ecrt_master_reference_clock_time(ec_master_t *m, uint32_t *time)
{
    note("reference_clock_time");
    *time = (uint32_t)(bus.reference ? bus.reference : m->app_time);
    return failure("reference_clock_time");
}

status ecrt_master_sync_monitor_queue(ec_master_t *m)
{
    note("sync_monitor_queue");
    m->monitoring = 1;
    DONE(0);
}

uint32_t ecrt_master_sync_monitor_process(ec_master_t *m)
{
    note("sync_monitor_process");
    if (bus.mainless || (bus.delay && monotonic() - bus.sent < bus.delay))
        return UINT32_MAX;
    return m->monitored ? bus.spread & 0x7FFFFFFF : UINT32_MAX;
}

/* Configurations */

int ecrt_slave_config_sync_manager(ec_slave_config_t *c, uint8_t sync, ec_direction_t direction,
                                   ec_watchdog_mode_t watchdog)
{
    note("sync_manager %d %u %u %u", c->position, sync, direction, watchdog);
    return 0;
}

status ecrt_slave_config_watchdog(ec_slave_config_t *c, uint16_t divider, uint16_t intervals)
{
    note("watchdog %d %u %u", c->position, divider, intervals);
    DONE(0);
}

int ecrt_slave_config_pdos(ec_slave_config_t *c, unsigned int count, const ec_sync_info_t *syncs)
{
    slave *s = &bus.all[c->position];
    if (failure("pdos"))
        return failure("pdos");
    for (unsigned int k = 0; k < count && syncs[k].index != 0xFF; k++) {
        pdo_map *map = &s->maps[syncs[k].index - 2];
        note("pdos %d sync %u dir %u pdos %u watchdog %u", c->position, syncs[k].index, syncs[k].dir,
             syncs[k].n_pdos, syncs[k].watchdog_mode);
        map->count = 0;
        for (unsigned int p = 0; p < syncs[k].n_pdos; p++) {
            map->pdo = syncs[k].pdos[p].index;
            for (unsigned int e = 0; e < syncs[k].pdos[p].n_entries; e++) {
                note("entry %04x %04x:%02x %u", map->pdo, syncs[k].pdos[p].entries[e].index,
                     syncs[k].pdos[p].entries[e].subindex,
                     syncs[k].pdos[p].entries[e].bit_length);
                map->entries[map->count++] = syncs[k].pdos[p].entries[e];
            }
        }
    }
    return 0;
}

int ecrt_slave_config_reg_pdo_entry_pos(ec_slave_config_t *c, uint8_t sync, unsigned int pdo,
                                        unsigned int entry, ec_domain_t *d, unsigned int *bit)
{
    int way = sync - 2;
    note("reg_pdo_entry_pos %d %u %u %u", c->position, sync, pdo, entry);
    if (failure("reg_pdo_entry_pos"))
        return failure("reg_pdo_entry_pos");
    *bit = 0;
    if (!c->syncs[way].registered) {
        c->syncs[way].registered = 1;
        c->syncs[way].domain = (int)(d - the_master->domains);
        c->syncs[way].offset = (int)d->size;
        d->size += (bits_of(&bus.all[c->position].maps[way]) + 7) / 8;
        d->expected += way == 0 ? 2 : 1;
    }
    return c->syncs[way].offset;
}

status ecrt_slave_config_dc(ec_slave_config_t *c, uint16_t assign_activate, uint32_t sync0_cycle,
                            int32_t sync0_shift, uint32_t sync1_cycle, int32_t sync1_shift)
{
    note("dc %d %04x %u %d %u %d", c->position, assign_activate, sync0_cycle, sync0_shift,
         sync1_cycle, sync1_shift);
    DONE(0);
}

int ecrt_slave_config_sdo(ec_slave_config_t *c, uint16_t index, uint8_t subindex,
                          const uint8_t *data, size_t size)
{
    object *o = find(&bus.all[c->position], index, subindex);
    note("config_sdo %d %04x:%02x %zu", c->position, index, subindex, size);
    if (o) {
        o->value = 0;
        memcpy(&o->value, data, size);
    }
    return 0;
}

int ecrt_slave_config_emerg_size(ec_slave_config_t *c, size_t elements)
{
    c->emergencies = elements;
    return 0;
}

int ecrt_slave_config_emerg_pop(ec_slave_config_t *c, uint8_t *target)
{
    slave *s = &bus.all[c->position];
    if (!c->emergencies || s->first_emergency == s->last_emergency)
        return -ENOENT;
    memcpy(target, s->emergencies[s->first_emergency++ % 16], 8);
    return 0;
}

ec_sdo_request_t *ecrt_slave_config_create_sdo_request(ec_slave_config_t *c, uint16_t index,
                                                       uint8_t subindex, size_t size)
{
    ec_sdo_request_t *r = &the_master->sdos[the_master->sdo_count++];
    note("create_sdo_request %d", c->position);
    *r = (ec_sdo_request_t){.position = c->position, .index = index, .subindex = subindex,
                            .room = size, .size = size, .data = calloc(1, size)};
    return r;
}

ec_reg_request_t *ecrt_slave_config_create_reg_request(ec_slave_config_t *c, size_t size)
{
    ec_reg_request_t *r = &the_master->registers[the_master->register_count++];
    *r = (ec_reg_request_t){.position = c->position, .data = calloc(1, size)};
    return r;
}

status ecrt_slave_config_state(const ec_slave_config_t *c, ec_slave_config_state_t *state)
{
    const slave *s = &bus.all[c->position];
    memset(state, 0, sizeof *state);
    if (!c->wrong && bus.cable && s->online) {
        state->online = 1;
        state->al_state = s->al;
        state->operational = s->al == OP;
    }
    DONE(0);
}

/* Domains and requests */

uint8_t *ecrt_domain_data(ec_domain_t *d) { return the_master->active ? d->data : NULL; }
size_t ecrt_domain_size(const ec_domain_t *d) { return d->size; }

status ecrt_domain_process(ec_domain_t *d)
{
    note("process %d", (int)(d - the_master->domains));
    d->early = bus.delay && monotonic() - bus.sent < bus.delay;
    bus.early += d->early;
    if (d->early)
        DONE(0);
    for (int k = 0; k < the_master->config_count && d->arrived; k++) {
        ec_slave_config_t *c = &the_master->configs[k];
        if (c->syncs[1].registered && &the_master->domains[c->syncs[1].domain] == d)
            memcpy(d->data + c->syncs[1].offset, d->input_copy + c->syncs[1].offset,
                   (bits_of(&bus.all[c->position].maps[1]) + 7) / 8);
    }
    DONE(0);
}

status ecrt_domain_queue(ec_domain_t *d)
{
    note("queue %d", (int)(d - the_master->domains));
    d->queued = 1;
    DONE(0);
}

status ecrt_domain_state(const ec_domain_t *d, ec_domain_state_t *state)
{
    note("domain_state %d", (int)(d - the_master->domains));
    int counter = d->early ? 0 : d->counter;
    state->working_counter = counter;
    state->wc_state = counter == d->expected && d->expected ? EC_WC_COMPLETE
                    : counter ? EC_WC_INCOMPLETE : EC_WC_ZERO;
    state->redundancy_active = bus.redundancy;
    DONE(0);
}

status ecrt_sdo_request_index(ec_sdo_request_t *r, uint16_t index, uint8_t subindex)
{
    note("sdo_request_index %d %04x:%02x", r->position, index, subindex);
    r->index = index;
    r->subindex = subindex;
    DONE(0);
}

status ecrt_sdo_request_timeout(ec_sdo_request_t *r, uint32_t timeout)
{
    (void)r, (void)timeout;
    DONE(0);
}

uint8_t *ecrt_sdo_request_data(ec_sdo_request_t *r) { return r->data; }
size_t ecrt_sdo_request_data_size(const ec_sdo_request_t *r) { return r->size; }
ec_request_state_t ecrt_sdo_request_state(ec_sdo_request_t *r) { return r->state; }

status ecrt_sdo_request_read(ec_sdo_request_t *r)
{
    note("sdo_request_read %d", r->position);
    r->state = EC_REQUEST_BUSY;
    r->pending = ANSWER_AFTER;
    DONE(0);
}

uint8_t *ecrt_reg_request_data(ec_reg_request_t *r) { return r->data; }
ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t *r) { return r->state; }

static void ask_register(ec_reg_request_t *r, uint16_t address, size_t size, int write)
{
    note("reg_request_%s %d %04x %zu", write ? "write" : "read", r->position, address, size);
    r->address = address;
    r->size = size;
    r->write = write;
    r->pending = ANSWER_AFTER;
    r->state = EC_REQUEST_BUSY;
}

status ecrt_reg_request_write(ec_reg_request_t *r, uint16_t address, size_t size)
{
    ask_register(r, address, size, 1);
    DONE(0);
}

status ecrt_reg_request_read(ec_reg_request_t *r, uint16_t address, size_t size)
{
    ask_register(r, address, size, 0);
    DONE(0);
}

#if RELEASE >= 60
int ecrt_slave_config_state_timeout(ec_slave_config_t *c, unsigned int from, unsigned int to,
                                    unsigned int timeout_ms)
{
    (void)c, (void)from, (void)to, (void)timeout_ms;
    return 0;
}
#endif

/* Controls for tests */

void double_reset(int slaves);

/* Number of slaves at the start, for programs without controls of the double. */
__attribute__((constructor)) static void double_begin(void)
{
    const char *slaves = getenv("DOUBLE_SLAVES");
    if (slaves)
        double_reset(atoi(slaves));
    bus.recording = getenv("DOUBLE_SILENT") == NULL;
}

void double_reset(int slaves)
{
    int k;
    if (the_master)
        ecrt_release_master(the_master);
    free(bus.record);
    memset(&bus, 0, sizeof bus);
    bus.recording = bus.cable = 1;
    bus.slaves = slaves;
    for (k = 0; k < slaves; k++)
        make_drive(&bus.all[k], k);
}

const char *double_calls(void) { return bus.record ? bus.record : ""; }
void double_forget(void) { bus.length = 0; if (bus.record) bus.record[0] = 0; }
void double_record(int on) { bus.recording = on; }
void double_absent(int absent) { bus.absent = absent; }
void double_scanning(int times) { bus.scanning = times; }
void double_cable(int plugged) { bus.cable = plugged; }
void double_redundancy(int active) { bus.redundancy = active; }
void double_reference(uint64_t time) { bus.reference = time; }
int double_reserved(void) { return bus.reserved; }
void double_state(int position, int al, int error)
{
    bus.all[position].al = al;
    bus.all[position].error = error;
    bus.all[position].unacknowledged = error ? 8 : 0;
}
void double_silent(int uploads) { bus.silent = uploads; }
void double_spread(uint32_t spread) { bus.spread = spread; }
void double_delay(int microseconds) { bus.delay = 1000LL * microseconds; }
void double_climb(int sends) { bus.climb = sends; }
void double_linger(int looks) { bus.lingering = looks; }
void double_refuse(uint32_t abort_code) { bus.refusal = abort_code; }
void double_measured(uint32_t delay) { bus.delay_to_next = delay; }
void double_mainless(int lost) { bus.mainless = lost; }
void double_ring(int closed) { bus.closed_ring = closed; }
int double_early(void) { int count = bus.early; bus.early = 0; return count; }
void double_block(int position) { bus.blocked = position + 1; }
void double_clockless(int position) { bus.all[position].clockless = 1; }
void double_plain(int position) { bus.all[position].plain = 1; }
void double_boot(int looks)
{
    for (int k = 0; k < bus.slaves; k++) {
        bus.all[k].al = 1;
        bus.all[k].booting = looks;
    }
}
void double_alias(int position, int alias) { bus.all[position].alias = alias; }
/* Exchange two devices. */
void double_swap(int a, int b)
{
    slave between = bus.all[a];
    bus.all[a] = bus.all[b];
    bus.all[b] = between;
    for (int k = 0; the_master && k < the_master->config_count; k++)
        find_slave(&the_master->configs[k]);
}
void double_online(int position, int online)
{
    bus.all[position].online = online;
    bus.all[position].al = PREOP;
    bus.all[position].sends = 0;
}
void double_register(int position, int address, int value)
{
    bus.all[position].registers[address] = value & 0xFF;
    bus.all[position].registers[address + 1] = value >> 8;
}
int double_register_at(int position, int address) { return bus.all[position].registers[address]; }
void double_fail(const char *name, int code)
{
    snprintf(bus.fail, sizeof bus.fail, "%s", name);
    bus.fail_with = code;
}
void double_set(int position, int index, int subindex, long value)
{
    find(&bus.all[position], index, subindex)->value = (uint64_t)value;
}
long double_value(int position, int index, int subindex)
{
    return (long)find(&bus.all[position], index, subindex)->value;
}
void double_emergency(int position, const uint8_t *message)
{
    memcpy(bus.all[position].emergencies[bus.all[position].last_emergency++ % 16], message, 8);
}
