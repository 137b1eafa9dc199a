/* Program for test_soem_soe.py: reads and writes IDNs of the drive at position 2 with SOEM, and
 * moves it by its telegrams. Each line of the output is one result. */
#include <stdio.h>
#include <string.h>
#include "ethercat.h"

#define DRIVE 2
#define LARGE 0x8012 /* P-0-0018 */

static char io_map[4096];
static uint8 list[4 + 4096];

static int value_of(uint16 idn) {
    int32 value = 0;
    int size = sizeof value;
    int wkc = ec_SoEread(DRIVE, 0, EC_SOE_VALUE_B, idn, &size, &value, EC_TIMEOUTRXM);
    printf("read %u: wkc %d, %d bytes, %d\n", idn, wkc, size, value);
    return value;
}

static void print_error(void) {
    ec_errort error;
    while (ec_poperror(&error))
        printf("error: idn %u code 0x%04X\n", error.Index, (unsigned)error.ErrorCode & 0xFFFF);
}

static void exchange_list(void) {
    uint16 lengths[2] = {4000, 4096};
    memcpy(list, lengths, sizeof lengths);
    for (int k = 0; k < 4000; k++) list[4 + k] = (uint8)(k * 7);
    int wkc = ec_SoEwrite(DRIVE, 0, EC_SOE_VALUE_B, LARGE, 4004, list, EC_TIMEOUTRXM);
    printf("write list: wkc %d\n", wkc);
    memset(list, 0, sizeof list);
    int size = sizeof list, same = 0;
    wkc = ec_SoEread(DRIVE, 0, EC_SOE_VALUE_B, LARGE, &size, list, EC_TIMEOUTRXM);
    for (int k = 0; k < 4000; k++) same += list[4 + k] == (uint8)(k * 7);
    printf("read list: wkc %d, %d bytes, %d equal\n", wkc, size, same);
}

static void move(void) {
    uint8 *out = ec_slave[DRIVE].outputs, *in = ec_slave[DRIVE].inputs;
    uint16 control = 0, status = 0;
    int32 target = 0, actual = 0;
    for (int k = 0; k < 1500; k++) {
        ec_send_processdata();
        ec_receive_processdata(EC_TIMEOUTRET);
        memcpy(&status, in, 2);
        memcpy(&actual, in + 2, 4);
        control = status >> 14 < 2 ? 0x8000 : 0xE000;
        target = status >> 14 < 3 ? actual : target + 100;
        memcpy(out, &control, 2);
        memcpy(out + 2, &target, 4);
        osal_usleep(1000);
    }
    printf("status %u, moved %s\n", status >> 14, actual > 50000 ? "yes" : "no");
}

int main(int argc, char **argv) {
    if (argc < 2 || !ec_init(argv[1]) || ec_config_init(FALSE) < DRIVE) return 1;
    ec_statecheck(0, EC_STATE_PRE_OP, EC_TIMEOUTSTATE);
    value_of(79);
    value_of(2);
    uint16 cycle = 2000;
    printf("write 2: wkc %d\n", ec_SoEwrite(DRIVE, 0, EC_SOE_VALUE_B, 2, 2, &cycle, EC_TIMEOUTRXM));
    value_of(2);
    exchange_list();
    value_of(4000);
    print_error();
    ec_config_map(&io_map); /* its search for further drives leaves errors */
    printf("sizes: %d bits out, %d bits in\n", ec_slave[DRIVE].Obits, ec_slave[DRIVE].Ibits);
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4);
    ec_send_processdata();
    ec_receive_processdata(EC_TIMEOUTRET);
    ec_slave[0].state = EC_STATE_OPERATIONAL;
    ec_writestate(0);
    for (int k = 0; k < 200 && ec_statecheck(0, EC_STATE_OPERATIONAL, 5000) != EC_STATE_OPERATIONAL; k++) {
        ec_send_processdata();
        ec_receive_processdata(EC_TIMEOUTRET);
    }
    ec_readstate();
    printf("state %d\n", ec_slave[DRIVE].state);
    move();
    ec_slave[0].state = EC_STATE_INIT;
    ec_writestate(0);
    ec_close();
    return 0;
}
