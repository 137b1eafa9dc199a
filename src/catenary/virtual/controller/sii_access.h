/* SII access, ETG.1000.4 §6.4: registers 0x0500 to 0x050F, and an EEPROM with access times. A read
 * returns 4 or 8 bytes (bit 6), and a write stores one word. Addresses are in words. */
#ifndef CATENARY_VIRTUAL_SII_ACCESS_H
#define CATENARY_VIRTUAL_SII_ACCESS_H

#include "controller/controller.h"

enum { SII_WORDS_CONFIGURATION = 8, SII_WORD_ALIAS = 4, SII_WORD_CHECKSUM = 7 };

/* Return the CRC-8 of the first 14 bytes: x^8 + x^2 + x + 1, initial value 0xFF (ETG.2010 §2.2). */
static uint8_t sii_checksum(const uint8_t *image) {
    uint8_t crc = 0xFF;
    for (int k = 0; k < 14; k++) {
        crc ^= image[k];
        for (int bit = 0; bit < 8; bit++)
            crc = (uint8_t)(crc & 0x80 ? crc << 1 ^ 0x07 : crc << 1);
    }
    return crc;
}

/* Load the configuration of the controller from the first words of the EEPROM, at power-on and for the
 * reload command. If the words are missing or their checksum is wrong, set error bits instead. Only the
 * first successful load sets the alias. */
static void sii_load(controller *c) {
    uint16_t control = load16(c->memory + REG_SII_CONTROL);
    control &= (uint16_t)~(SII_ERROR_CHECKSUM | SII_ERROR_LOADING);
    const uint8_t *image = c->sii.image;
    if (c->sii.words < SII_WORDS_CONFIGURATION)
        control |= SII_ERROR_LOADING | SII_ERROR_CHECKSUM;
    else if (sii_checksum(image) != image[SII_WORD_CHECKSUM * 2])
        control |= SII_ERROR_CHECKSUM;
    else {
        memcpy(c->memory + REG_PDI_CONTROL, image, 2);
        memcpy(c->memory + REG_PDI_CONFIGURATION, image + 2, 2);
        memcpy(c->memory + REG_SYNC_PULSE_LENGTH, image + 4, 2);
        memcpy(c->memory + REG_PDI_CONFIGURATION_EXTENDED, image + 6, 2);
        if (!c->sii.loaded)
            memcpy(c->memory + REG_ALIAS, image + SII_WORD_ALIAS * 2, 2);
        c->sii.loaded = 1;
        c->emulation = image[1] & 1;
    }
    store16(c->memory + REG_SII_CONTROL, control);
}

static inline int sii_accessible(const controller *c) {
    return !(c->memory[REG_SII_OWNER] & 1) && !(load16(c->memory + REG_SII_CONTROL) & SII_BUSY);
}

static inline void sii_start(controller *c, uint16_t command, int64_t time) {
    uint8_t *control = c->memory + REG_SII_CONTROL;
    c->sii.pending = command;
    c->sii.address = load32(c->memory + REG_SII_ADDRESS);
    c->sii.word = load16(c->memory + REG_SII_DATA);
    c->sii.due = c->segment->now + time;
    store16(control, load16(control) | SII_BUSY);
    due_at(c, c->sii.due);
    if (c->sii.due < c->segment->sii_due)
        c->segment->sii_due = c->sii.due;
}

/* Handle a write of `value` to the control word. An invalid command sets an error bit. */
static void sii_command(controller *c, uint16_t value) {
    uint8_t *control = c->memory + REG_SII_CONTROL;
    uint16_t status = load16(control) & (uint16_t)~(SII_ERROR_COMMAND | SII_ERROR_WRITE_ENABLE);
    uint16_t command = value & SII_COMMAND;
    status = (uint16_t)((status & ~(SII_COMMAND | SII_WRITE_ENABLE)) | command | (value & SII_WRITE_ENABLE));
    store16(control, status);
    if (command == 0)
        return;
    if (command == SII_COMMAND_READ || command == SII_COMMAND_RELOAD)
        sii_start(c, command, c->sii.read_time);
    else if (command != SII_COMMAND_WRITE)
        store16(control, status | SII_ERROR_COMMAND);
    else if (!(value & SII_WRITE_ENABLE))
        store16(control, status | SII_ERROR_WRITE_ENABLE);
    else
        sii_start(c, command, c->sii.write_time);
}

static inline uint16_t sii_word(const controller *c, uint32_t address) {
    return address < c->sii.words ? load16(c->sii.image + 2 * address) : 0xFFFF;
}

static void sii_check(controller *c) {
    if (c->sii.pending == 0 || c->sii.due > c->segment->now)
        return;
    uint8_t *control = c->memory + REG_SII_CONTROL;
    uint16_t status = load16(control);
    int words = status & SII_READ_8 ? 4 : 2;
    if (c->sii.pending == SII_COMMAND_READ)
        for (int k = 0; k < words; k++)
            store16(c->memory + REG_SII_DATA + 2 * k, sii_word(c, c->sii.address + (uint32_t)k));
    else if (c->sii.pending == SII_COMMAND_RELOAD)
        sii_load(c);
    else if (c->sii.address < c->sii.words)
        store16(c->sii.image + 2 * c->sii.address, c->sii.word);
    else
        store16(control, status | SII_ERROR_COMMAND);   /* beyond its end, the EEPROM does not acknowledge */
    c->sii.pending = 0;
    c->sii.due = NEVER;
    store16(control, load16(control) & (uint16_t)~(SII_BUSY | SII_COMMAND | SII_WRITE_ENABLE));
}

#endif
