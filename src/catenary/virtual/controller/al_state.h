/* Controller side of AL control and AL status, ETG.1000.4 §5.3 and ETG.1000.6 §6.4.1.
 *
 * With device emulation, the status follows the control word, including the error bit (ET1100
 * datasheet, 0x0140.8), because no application checks it. Otherwise the control register is locked
 * after a write, until the application has fetched it. */
#ifndef CATENARY_VIRTUAL_AL_STATE_H
#define CATENARY_VIRTUAL_AL_STATE_H

#include "controller/controller.h"
#include "controller/sync_manager.h"

enum { AL_INIT = 1, AL_PRE_OP = 2, AL_BOOT = 3, AL_SAFE_OP = 4, AL_OP = 8 };

static void al_show(controller *c, uint16_t status, uint16_t code) {
    store16(c->memory + REG_AL_STATUS, status);
    store16(c->memory + REG_AL_STATUS_CODE, code);
    uint8_t *event = c->memory + REG_ECAT_EVENT;
    store16(event, load16(event) | ECAT_EVENT_AL_STATUS);
}

static void al_control_written(controller *c) {
    uint16_t control = load16(c->memory + REG_AL_CONTROL);
    if (!c->emulation) {
        c->al_unread = 1;
        raise_event(c, EVENT_AL_CONTROL);
        return;
    }
    uint16_t status = control & (AL_STATE | AL_ERROR);
    uint16_t code = 0;
    if ((control & AL_IDENTIFICATION) && c->identification) {
        status |= AL_IDENTIFICATION;
        code = c->identification;
    }
    al_show(c, status, code);
    c->outputs_valid = (status & AL_STATE) == AL_OP && !c->watchdog_expired;
}

#endif
