/* Interface of a test double of libethercat, written from the numbers of abi.json.
 *
 * It is compiled with VERSION_MAGIC, with RETURNS_VOID for releases with void functions, and with
 * RELEASE 2 (1.5.2), 3 (1.5.3) or 60 (1.6.0 and later).
 */
#ifndef DOUBLE_H
#define DOUBLE_H

#include <stddef.h>
#include <stdint.h>

#ifdef RETURNS_VOID
typedef void status;
#else
typedef int status;
#endif

#define ECRT_VERSION_MAGIC VERSION_MAGIC
#define EC_END ~0U
#define EC_MAX_SYNC_MANAGERS 16
#define EC_MAX_STRING_LENGTH 64
#define EC_MAX_PORTS 4

typedef struct double_master ec_master_t;
typedef struct double_config ec_slave_config_t;
typedef struct double_domain ec_domain_t;
typedef struct double_sdo ec_sdo_request_t;
typedef struct double_register ec_reg_request_t;

typedef enum { EC_DIR_INVALID, EC_DIR_OUTPUT, EC_DIR_INPUT } ec_direction_t;
typedef enum { EC_WD_DEFAULT, EC_WD_ENABLE, EC_WD_DISABLE } ec_watchdog_mode_t;
typedef enum { EC_WC_ZERO, EC_WC_INCOMPLETE, EC_WC_COMPLETE } ec_wc_state_t;
typedef enum {
    EC_REQUEST_UNUSED, EC_REQUEST_BUSY, EC_REQUEST_SUCCESS, EC_REQUEST_ERROR
} ec_request_state_t;

typedef struct {
    uint32_t slaves_responding;
    uint32_t al_states : 4, link_up : 1;
} ec_master_state_t;

typedef struct {
    uint32_t slaves_responding;
    uint32_t al_states : 4, link_up : 1;
} ec_master_link_state_t;

typedef struct {
    uint32_t online : 1, operational : 1, al_state : 4;
} ec_slave_config_state_t;

typedef struct {
    uint32_t slave_count;
    uint32_t link_up : 1;
    uint8_t scan_busy;
    uint64_t app_time;
} ec_master_info_t;

typedef struct { uint8_t link_up, loop_closed, signal_detected; } ec_slave_port_link_t;

typedef struct {
    uint16_t position;
    uint32_t vendor_id, product_code, revision_number, serial_number;
    uint16_t alias;
    int16_t current_on_ebus;
    struct {
        uint32_t desc;
        ec_slave_port_link_t link;
        uint32_t receive_time;
        uint16_t next_slave;
        uint32_t delay_to_next_dc;
    } ports[EC_MAX_PORTS];
    uint8_t al_state, error_flag, sync_count;
    uint16_t sdo_count;
    char name[EC_MAX_STRING_LENGTH];
} ec_slave_info_t;

typedef struct {
    uint32_t working_counter;
    ec_wc_state_t wc_state;
    uint32_t redundancy_active;
} ec_domain_state_t;

typedef struct { uint16_t index; uint8_t subindex, bit_length; } ec_pdo_entry_info_t;

typedef struct {
    uint16_t index;
    unsigned int n_entries;
    const ec_pdo_entry_info_t *entries;
} ec_pdo_info_t;

typedef struct {
    uint8_t index;
    ec_direction_t dir;
    unsigned int n_pdos;
    const ec_pdo_info_t *pdos;
    ec_watchdog_mode_t watchdog_mode;
} ec_sync_info_t;

typedef struct {
    uint16_t alias, position;
    uint32_t vendor_id, product_code;
    uint16_t index;
    uint8_t subindex;
    unsigned int *offset, *bit_position;
} ec_pdo_entry_reg_t;

unsigned int ecrt_version_magic(void);
ec_master_t *ecrt_request_master(unsigned int index);
void ecrt_release_master(ec_master_t *m);
ec_domain_t *ecrt_master_create_domain(ec_master_t *m);
ec_slave_config_t *ecrt_master_slave_config(ec_master_t *m, uint16_t alias, uint16_t position,
                                            uint32_t vendor, uint32_t product);
int ecrt_master_select_reference_clock(ec_master_t *m, ec_slave_config_t *c);
int ecrt_master(ec_master_t *m, ec_master_info_t *info);
int ecrt_master_get_slave(ec_master_t *m, uint16_t position, ec_slave_info_t *info);
int ecrt_master_get_sync_manager(ec_master_t *m, uint16_t position, uint8_t sync,
                                 ec_sync_info_t *info);
int ecrt_master_get_pdo(ec_master_t *m, uint16_t position, uint8_t sync, uint16_t rank,
                        ec_pdo_info_t *info);
int ecrt_master_get_pdo_entry(ec_master_t *m, uint16_t position, uint8_t sync, uint16_t pdo,
                              uint16_t rank, ec_pdo_entry_info_t *info);
int ecrt_master_sdo_download(ec_master_t *m, uint16_t position, uint16_t index, uint8_t subindex,
                             const uint8_t *data, size_t size, uint32_t *abort_code);
int ecrt_master_sdo_download_complete(ec_master_t *m, uint16_t position, uint16_t index,
                                      const uint8_t *data, size_t size, uint32_t *abort_code);
int ecrt_master_sdo_upload(ec_master_t *m, uint16_t position, uint16_t index, uint8_t subindex,
                           uint8_t *target, size_t size, size_t *result, uint32_t *abort_code);
int ecrt_master_activate(ec_master_t *m);
status ecrt_master_deactivate(ec_master_t *m);
int ecrt_master_set_send_interval(ec_master_t *m, size_t interval);
status ecrt_master_send(ec_master_t *m);
status ecrt_master_receive(ec_master_t *m);
status ecrt_master_state(const ec_master_t *m, ec_master_state_t *state);
int ecrt_master_link_state(const ec_master_t *m, unsigned int device, ec_master_link_state_t *state);
status ecrt_master_application_time(ec_master_t *m, uint64_t time);
status ecrt_master_sync_reference_clock(ec_master_t *m);
#if RELEASE > 2
status ecrt_master_sync_reference_clock_to(ec_master_t *m, uint64_t time);
#endif
status ecrt_master_sync_slave_clocks(ec_master_t *m);
int ecrt_master_reference_clock_time(ec_master_t *m, uint32_t *time);
status ecrt_master_sync_monitor_queue(ec_master_t *m);
uint32_t ecrt_master_sync_monitor_process(ec_master_t *m);
int ecrt_slave_config_sync_manager(ec_slave_config_t *c, uint8_t sync, ec_direction_t direction,
                                   ec_watchdog_mode_t watchdog);
status ecrt_slave_config_watchdog(ec_slave_config_t *c, uint16_t divider, uint16_t intervals);
int ecrt_slave_config_pdos(ec_slave_config_t *c, unsigned int count, const ec_sync_info_t *syncs);
int ecrt_slave_config_reg_pdo_entry_pos(ec_slave_config_t *c, uint8_t sync, unsigned int pdo,
                                        unsigned int entry, ec_domain_t *d, unsigned int *bit);
status ecrt_slave_config_dc(ec_slave_config_t *c, uint16_t assign_activate, uint32_t sync0_cycle,
                            int32_t sync0_shift, uint32_t sync1_cycle, int32_t sync1_shift);
int ecrt_slave_config_sdo(ec_slave_config_t *c, uint16_t index, uint8_t subindex,
                          const uint8_t *data, size_t size);
int ecrt_slave_config_emerg_size(ec_slave_config_t *c, size_t elements);
int ecrt_slave_config_emerg_pop(ec_slave_config_t *c, uint8_t *target);
ec_sdo_request_t *ecrt_slave_config_create_sdo_request(ec_slave_config_t *c, uint16_t index,
                                                       uint8_t subindex, size_t size);
ec_reg_request_t *ecrt_slave_config_create_reg_request(ec_slave_config_t *c, size_t size);
status ecrt_slave_config_state(const ec_slave_config_t *c, ec_slave_config_state_t *state);
uint8_t *ecrt_domain_data(ec_domain_t *d);
size_t ecrt_domain_size(const ec_domain_t *d);
status ecrt_domain_process(ec_domain_t *d);
status ecrt_domain_queue(ec_domain_t *d);
status ecrt_domain_state(const ec_domain_t *d, ec_domain_state_t *state);
status ecrt_sdo_request_index(ec_sdo_request_t *r, uint16_t index, uint8_t subindex);
status ecrt_sdo_request_timeout(ec_sdo_request_t *r, uint32_t timeout);
uint8_t *ecrt_sdo_request_data(ec_sdo_request_t *r);
size_t ecrt_sdo_request_data_size(const ec_sdo_request_t *r);
ec_request_state_t ecrt_sdo_request_state(ec_sdo_request_t *r);
status ecrt_sdo_request_read(ec_sdo_request_t *r);
uint8_t *ecrt_reg_request_data(ec_reg_request_t *r);
ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t *r);
status ecrt_reg_request_write(ec_reg_request_t *r, uint16_t address, size_t size);
status ecrt_reg_request_read(ec_reg_request_t *r, uint16_t address, size_t size);
#if RELEASE >= 60
int ecrt_slave_config_state_timeout(ec_slave_config_t *c, unsigned int from, unsigned int to,
                                    unsigned int timeout_ms);
#endif

#endif
