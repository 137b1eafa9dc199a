/* Frames and datagrams, ETG.1000.4 §5.4: the fifteen commands, addressing and working counters.
 *
 * The content of a frame is not trusted. An invalid length ends the processing of a frame, and its
 * rest returns unchanged. Time budget: 0.1 us for each datagram and accessed device. */
#ifndef CATENARY_VIRTUAL_DATAGRAM_H
#define CATENARY_VIRTUAL_DATAGRAM_H

#include "al_state.h"
#include "controller/controller.h"
#include "fmmu.h"
#include "frame_faults.h"
#include "process_data.h"
#include "sii_access.h"
#include "sync_manager.h"
#include "sync_unit.h"
#include "watchdog.h"
#include "write_protection.h"

enum { NOP, APRD, APWR, APRW, FPRD, FPWR, FPRW, BRD, BWR, BRW, LRD, LWR, LRW, ARMW, FRMW };

enum {
    ETHERNET_HEADER = 14,
    ETHERCAT_HEADER = 2,
    DATAGRAM_HEADER = 10,
    CIRCULATING = 0x40                /* bit of a datagram's second length byte */
};

static void fill_mask(uint8_t *mask, uint32_t address, uint32_t size, uint8_t bits) {
    memset(mask + address, bits, size);
}

/* Set the mask of bits that a MainDevice may change. A 0 bit is read-only or not modelled. */
static void make_write_mask(uint8_t *mask) {
    memset(mask, 0, REG_END);
    fill_mask(mask, REG_STATION, 2, 0xFF);
    mask[REG_WRITE_ENABLE] = mask[REG_WRITE_PROTECTION] = 0x01;
    mask[REG_ESC_WRITE_ENABLE] = mask[REG_ESC_WRITE_PROTECTION] = 0x01;
    mask[REG_RESET] = 0xFF;
    mask[REG_DL_CONTROL] = 0x03;
    mask[REG_DL_CONTROL + 1] = 0xFF;
    mask[REG_DL_CONTROL + 2] = 0x07;
    mask[REG_DL_CONTROL + 3] = DL_CONTROL_ALIAS;
    mask[REG_AL_CONTROL] = AL_STATE | AL_ERROR | AL_IDENTIFICATION;
    fill_mask(mask, REG_ECAT_EVENT_MASK, 2, 0xFF);
    fill_mask(mask, REG_RX_ERRORS, 14, 0xFF);
    fill_mask(mask, REG_LOST_LINKS, 4, 0xFF);
    fill_mask(mask, REG_WATCHDOG_DIVIDER, 2, 0xFF);
    fill_mask(mask, REG_WATCHDOG_PDI, 2, 0xFF);
    fill_mask(mask, REG_WATCHDOG_PROCESS_DATA, 2, 0xFF);
    fill_mask(mask, REG_WATCHDOG_COUNTER_PROCESS_DATA, 2, 0xFF);
    mask[REG_SII_OWNER] = 0x03;
    mask[REG_SII_CONTROL] = SII_WRITE_ENABLE;
    mask[REG_SII_CONTROL + 1] = SII_COMMAND >> 8;
    fill_mask(mask, REG_SII_ADDRESS, REG_SII_END - REG_SII_ADDRESS, 0xFF);
    for (int n = 0; n < MAX_FMMU; n++) {
        static const uint8_t bits[FMMU_SIZE] = {255, 255, 255, 255, 255, 255, 7, 7, 255, 255, 7, 3, 1};
        memcpy(mask + REG_FMMU + n * FMMU_SIZE, bits, FMMU_SIZE);
    }
    for (int n = 0; n < MAX_SM; n++) {
        static const uint8_t bits[SM_SIZE] = {255, 255, 255, 255, 0x7F, 0, 0xC3, 0};
        memcpy(mask + REG_SM + n * SM_SIZE, bits, SM_SIZE);
    }
    fill_mask(mask, REG_DC_RECEIVE, 4, 0xFF);
    fill_mask(mask, REG_DC_SYSTEM_TIME, 8, 0xFF);
    fill_mask(mask, REG_DC_OFFSET, 12, 0xFF);
    fill_mask(mask, REG_DC_SPEED_START, 2, 0xFF);
    fill_mask(mask, REG_DC_FILTER_DIFFERENCE, 2, 0x0F);
    fill_mask(mask, REG_SYNC_CONTROL, 1, 0x31);
    fill_mask(mask, REG_SYNC_ACTIVATION, 1, 0x07);
    fill_mask(mask, REG_SYNC_START, 8, 0xFF);
    fill_mask(mask, REG_SYNC0_CYCLE, 8, 0xFF);
    fill_mask(mask, REG_LATCH_CONTROL, 2, 0x03);
    fill_mask(mask, REG_USER_RAM, REG_END - REG_USER_RAM, 0xFF);
}

/* Return 1 if a frame may write this register byte now, in the present state of the controller. */
static inline int register_open(const controller *c, uint32_t address) {
    if (address >= REG_SII_CONTROL && address < REG_SII_END)
        return sii_accessible(c);
    if (address >= REG_AL_CONTROL && address < REG_AL_CONTROL + 2)
        return !c->al_unread;
    if (address >= REG_SM && address < REG_SM + MAX_SM * SM_SIZE) {
        int n = (int)(address - REG_SM) / SM_SIZE;
        int locked = c->memory[REG_SM + n * SM_SIZE + 6] & SM_ACTIVATE_ENABLE;
        return n < c->sm_count && (address % SM_SIZE >= 5 || !locked);
    }
    if (address >= REG_FMMU && address < REG_FMMU + MAX_FMMU * FMMU_SIZE)
        return (int)(address - REG_FMMU) / FMMU_SIZE < c->fmmu_count;
    if (address >= REG_DC_RECEIVE && address < REG_USER_RAM)
        return c->has_dc && clock_register_open(c, address);
    return 1;
}

static inline int touches(uint32_t first, uint32_t end, uint32_t address, uint32_t size) {
    return first < address + size && end > address;
}

static void sync_managers_written(controller *c, uint32_t first, uint32_t end, const uint8_t *activate_before) {
    for (int n = 0; n < c->sm_count; n++) {
        if (!touches(first, end, REG_SM + (uint32_t)n * SM_SIZE, SM_SIZE))
            continue;
        sm_configured(c, n);
        uint8_t changed = activate_before[n] ^ sm_registers(c, n)[6];
        if (n == 1 && (changed & SM_ACTIVATE_REPEAT) && c->sm[n].enabled)
            raise_event(c, EVENT_REPEAT_REQUEST);
    }
}

static void clear_error_counters(controller *c, uint32_t first, uint32_t end) {
    static const struct { uint16_t address; uint8_t size; } groups[] = {
        {REG_RX_ERRORS, 8}, {REG_RX_ERRORS + 8, 4}, {REG_RX_ERRORS + 12, 1},
        {REG_RX_ERRORS + 13, 1}, {REG_LOST_LINKS, 4}, {REG_WATCHDOG_COUNTER_PROCESS_DATA, 1},
        {REG_WATCHDOG_COUNTER_PDI, 1}};
    for (size_t k = 0; k < sizeof groups / sizeof *groups; k++)
        if (touches(first, end, groups[k].address, groups[k].size))
            memset(c->memory + groups[k].address, 0, groups[k].size);
}

/* Apply the effects of a write to registers [first, end). */
static void registers_written(controller *c, uint32_t first, uint32_t end, const uint8_t *data,
                              const uint8_t *activate_before, int64_t passage) {
    if (touches(first, end, REG_WRITE_ENABLE, REG_ESC_WRITE_PROTECTION + 1 - REG_WRITE_ENABLE))
        protection_written(c);
    if (touches(first, end, REG_RESET, 1))
        reset_written(c);
    if (touches(first, end, REG_AL_CONTROL, 1))
        al_control_written(c);
    if (touches(first, end, REG_RX_ERRORS, REG_LOST_LINKS + 4 - REG_RX_ERRORS)
        || touches(first, end, REG_WATCHDOG_COUNTER_PROCESS_DATA, 2))
        clear_error_counters(c, first, end);
    if (touches(first, end, REG_WATCHDOG_DIVIDER, 2) || touches(first, end, REG_WATCHDOG_PROCESS_DATA, 2))
        watchdog_reconfigured(c);
    if (touches(first, end, REG_SII_CONTROL, 2) && sii_accessible(c))
        sii_command(c, load16(c->memory + REG_SII_CONTROL));
    if (touches(first, end, REG_FMMU, MAX_FMMU * FMMU_SIZE))
        for (int n = 0; n < c->fmmu_count; n++)
            if (touches(first, end, REG_FMMU + (uint32_t)n * FMMU_SIZE, FMMU_SIZE))
                fmmu_configured(c, n);
    if (touches(first, end, REG_SM, MAX_SM * SM_SIZE))
        sync_managers_written(c, first, end, activate_before);
    if (!c->has_dc || first >= REG_LATCH_CONTROL || end <= REG_DC_RECEIVE)
        return;
    if (touches(first, end, REG_DC_RECEIVE, 1)) {
        const cat_segment *s = c->segment;
        dc_latch(c, s->passage, s->route->times + PORTS * c->position, passage);
    }
    clock_registers_written(c, first, end, data, passage);
}

/* Write registers and apply the effects of the write. Return 1 if any byte was written. The write mask
 * protects the status bits of the SII control word. The other bits of this word can be written only
 * while the SII is accessible. */
static int register_write(controller *c, uint32_t address, uint32_t size, const uint8_t *data, int64_t passage) {
    uint8_t activate[MAX_SM], loops = c->memory[REG_DL_CONTROL + 1];
    int done = 0;
    for (int n = 0; n < MAX_SM; n++)
        activate[n] = sm_registers(c, n)[6];
    uint32_t changed_first = address + size, changed_end = address;
    for (uint32_t k = 0; k < size; k++) {
        uint32_t a = address + k;
        uint8_t mask = c->segment->write_mask[a];
        if (mask == 0 || !register_open(c, a) || !byte_unprotected(c, a))
            continue;
        c->memory[a] = (uint8_t)((c->memory[a] & ~mask) | (data[k] & mask));
        done = 1;
        changed_first = min32(changed_first, a);
        changed_end = a + 1;
    }
    if (!done)
        return 0;
    if (touches(changed_first, changed_end, REG_DL_CONTROL + 1, 1))
        loop_control_written(c, loops);
    registers_written(c, changed_first, changed_end, data + (changed_first - address), activate, passage);
    return 1;
}

static void register_read(controller *c, uint32_t address, uint32_t size, uint8_t *data, int64_t passage) {
    uint32_t end = address + size;
    if (c->has_dc && touches(address, end, REG_DC_SYSTEM_TIME, 8))
        dc_refresh(c, passage);
    memcpy(data, c->memory + address, size);
    if (c->has_dc && touches(address, end, REG_LATCH_TIMES, REG_LATCH_END - REG_LATCH_TIMES))
        latch_times_read(c, address, end);
    uint8_t *event = c->memory + REG_ECAT_EVENT;
    if (touches(address, end, REG_AL_STATUS, 2))
        store16(event, load16(event) & (uint16_t)~ECAT_EVENT_AL_STATUS);
    if (touches(address, end, REG_DL_STATUS, 2))
        store16(event, load16(event) & (uint16_t)~ECAT_EVENT_DL_STATUS);
}

/* Write to physical memory, clipped to its size. Return 1 if any byte was written. */
static int physical_write(controller *c, uint32_t address, uint32_t size, const uint8_t *data, int64_t passage) {
    int done = 0;
    if (address < REG_END) {
        uint32_t part = min32(size, REG_END - address);
        done = register_write(c, address, part, data, passage);
        address += part;
        data += part;
        size -= part;
    }
    if (size == 0 || address >= c->memory_size || !ram_unprotected(c))
        return done;
    return done | ram_access(c, address, min32(size, c->memory_size - address), (uint8_t *)data, 1);
}

static int physical_read(controller *c, uint32_t address, uint32_t size, uint8_t *data, int64_t passage) {
    int done = 0;
    if (address < REG_END) {
        uint32_t part = min32(size, REG_END - address);
        register_read(c, address, part, data, passage);
        done = 1;
        address += part;
        data += part;
        size -= part;
    }
    if (size == 0 || address >= c->memory_size)
        return done;
    return done | ram_access(c, address, min32(size, c->memory_size - address), data, 0);
}

/* Read and write: the returned data is from before the write. Return the increment of the working
 * counter. */
static int physical_exchange(controller *c, uint32_t address, uint32_t size, uint8_t *data, int64_t passage) {
    uint8_t *incoming = c->segment->incoming;
    memcpy(incoming, data, size);
    int counter = physical_read(c, address, size, data, passage);
    return counter + 2 * physical_write(c, address, size, incoming, passage);
}

static int physical_command(controller *c, int action, uint32_t address, uint32_t size, uint8_t *data, int64_t passage) {
    if (action == APRD)
        return physical_read(c, address, size, data, passage);
    if (action == APWR)
        return physical_write(c, address, size, data, passage);
    return physical_exchange(c, address, size, data, passage);
}

static int broadcast_command(controller *c, int command, uint32_t address, uint32_t size, uint8_t *data, int64_t passage) {
    if (command == BWR)
        return physical_write(c, address, size, data, passage);
    uint8_t *incoming = c->segment->incoming, *own = c->segment->scratch;
    memset(own, 0, size);
    if (command == BRW)
        memcpy(incoming, data, size);
    int counter = physical_read(c, address, size, own, passage);
    for (uint32_t k = 0; k < size; k++)
        data[k] |= own[k];
    if (command == BRW)
        counter += 2 * physical_write(c, address, size, incoming, passage);
    return counter;
}

static inline int station_matches(const controller *c, uint16_t station) {
    return load16(c->memory + REG_STATION) == station
        || ((c->memory[REG_DL_CONTROL + 3] & DL_CONTROL_ALIAS) && load16(c->memory + REG_ALIAS) == station);
}

/* Process one datagram at one controller, and return the increment of the working counter. `header`
 * points to the ten bytes of its header. Auto-increment and broadcast commands increment ADP. */
static int datagram_at(controller *c, uint8_t *header, uint32_t size, uint8_t *data, int64_t passage) {
    int command = header[0];
    uint16_t adp = load16(header + 2);
    uint32_t ado = load16(header + 4);
    if (command == LRD || command == LWR || command == LRW)
        return c->mute ? 0 : fmmu_datagram(c, load32(header + 2), size, data, command != LWR,
                                           command != LRD && ram_unprotected(c));
    if (command == FPRD || command == FPWR || command == FPRW)
        return station_matches(c, adp) ? physical_command(c, command - FPRD + APRD, ado, size, data, passage) : 0;
    if (command == FRMW)
        return station_matches(c, adp) ? physical_read(c, ado, size, data, passage)
                                       : physical_write(c, ado, size, data, passage);
    store16(header + 2, (uint16_t)(adp + 1));
    if (command == BRD || command == BWR || command == BRW)
        return broadcast_command(c, command, ado, size, data, passage);
    if (command == ARMW)
        return adp == 0 ? physical_read(c, ado, size, data, passage) : physical_write(c, ado, size, data, passage);
    return adp == 0 ? physical_command(c, command, ado, size, data, passage) : 0;
}

/* Process one datagram in the first `stops` processing units of a route. */
static void datagram_through(cat_segment *s, const route *r, uint32_t stops, uint8_t *header, uint32_t size) {
    uint8_t *data = header + DATAGRAM_HEADER;
    uint16_t counter = load16(data + size), interrupts = load16(header + 8);
    int command = header[0];
    if (command == NOP || command > FRMW)
        return;
    for (const stop *at = r->stops, *end = r->stops + stops; at < end; at++) {
        controller *c = at->controller;
        c->passage = s->passage + at->offset;
        counter = (uint16_t)(counter + datagram_at(c, header, size, data, c->passage));
        interrupts |= load16(c->memory + REG_ECAT_EVENT) & load16(c->memory + REG_ECAT_EVENT_MASK);
    }
    store16(header + 8, interrupts);
    store16(data + size, counter);
}

/* Count a frame with an invalid type or length, in the segment and in the first `stops` processing
 * units of the route. */
static void frame_malformed(cat_segment *s, const route *r, uint32_t stops) {
    s->counters.malformed++;
    for (uint32_t k = 0; k < stops; k++)
        count_up(r->stops[k].controller->memory + REG_PROCESSING_UNIT_ERRORS);
}

/* Process a complete Ethernet frame in place, in the first `stops` processing units of a route.
 * `mark`: mark its datagrams as circulating, because of a closed port 0 on the route. */
static void frame_process(cat_segment *s, const route *r, uint32_t stops, int mark, uint8_t *frame, uint32_t length) {
    uint16_t head = load16(frame + ETHERNET_HEADER);
    uint32_t at = ETHERNET_HEADER + ETHERCAT_HEADER;
    uint32_t end = at + (head & 0x07FF);
    s->route = r;
    inputs_flush(s);
    if (stops > 0)
        frame[6] |= 0x02;             /* controllers set the "locally administered" bit of processed frames */
    if (head >> 12 != 1 || end > length) {
        frame_malformed(s, r, stops);
        return;
    }
    while (at + DATAGRAM_HEADER + 2 <= end) {
        uint8_t *header = frame + at;
        uint16_t field = load16(header + 6);
        uint32_t size = field & 0x07FF;
        if (at + DATAGRAM_HEADER + size + 2 > end)
            break;
        datagram_through(s, r, stops, header, size);
        if (mark)
            header[7] |= CIRCULATING;
        s->counters.datagrams++;
        at += DATAGRAM_HEADER + size + 2;
        if (!(field & 0x8000))
            return;
    }
    frame_malformed(s, r, stops);
}

static inline int frame_is_ours(const uint8_t *frame, uint32_t length) {
    return length >= ETHERNET_HEADER + ETHERCAT_HEADER && frame[12] == 0x88 && frame[13] == 0xA4;
}

static inline int frame_is_marked(const uint8_t *frame, uint32_t length) {
    uint32_t at = ETHERNET_HEADER + ETHERCAT_HEADER + 7;
    return length > at && (frame[at] & CIRCULATING);
}

/* Process a frame along its complete route. Return the interface at which it leaves, or -cause if it
 * is lost. */
static int frame_through(cat_segment *s, const route *r, const fate *fate, uint8_t *frame, uint32_t length) {
    uint32_t stops = r->stop_count;
    int exit = r->exit, mark = r->circulates > 0;
    s->counters.frames++;
    if (s->epoch < 0) {
        s->epoch = s->now;
        s->pending = 1;
        wake_service(s);
    }
    if (fate->lose_out)
        return -LOSS_INJECTED;
    if (mark && frame_is_marked(frame, length)) {
        stops = r->circulates - 1;
        exit = -LOSS_CIRCULATING;
    }
    if (fate->corrupt && fate->corrupt->stops <= stops) {
        stops = fate->corrupt->stops;
        exit = -LOSS_CORRUPT;
        frame_corrupted(s, r, fate->corrupt);
    }
    frame_process(s, r, stops, mark, frame, length);
    if (r->opens >= 0)
        loop_opened_by_frame(&s->controllers[r->opens / PORTS], r->opens % PORTS);
    if (exit < 0)
        return exit;
    return fate->lose_back ? -LOSS_INJECTED : exit;
}

#endif
