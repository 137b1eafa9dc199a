/* Commands, sizes and masks of EtherCAT for C and Cython, one definition for all compiled modules.
 * Python has its own definitions (wire/datagram.py, wire/frame.py, wire/al.py);
 * tests/core/test_ethercat.py compares the two. */
#ifndef CATENARY_ETHERCAT_H
#define CATENARY_ETHERCAT_H

enum { /* commands, ETG.1000.4 §5.4.1 */
    CAT_NOP = 0,
    CAT_APRD = 1,
    CAT_APWR = 2,
    CAT_APRW = 3,
    CAT_FPRD = 4,
    CAT_FPWR = 5,
    CAT_FPRW = 6,
    CAT_BRD = 7,
    CAT_BWR = 8,
    CAT_BRW = 9,
    CAT_LRD = 10,
    CAT_LWR = 11,
    CAT_LRW = 12,
    CAT_ARMW = 13,
    CAT_FRMW = 14
};

enum { /* sizes, ETG.1000.4 §5.3 and §5.4 */
    CAT_ETHERNET_HEADER = 14,
    CAT_ETHERCAT_HEADER = 2,
    CAT_DATAGRAM_HEADER = 10,
    CAT_DATAGRAM_COUNTER = 2
};

enum { /* AL status 0x0130, ETG.1000.6 §5.3.2 */
    CAT_AL_STATE = 0x0F,              /* mask of the state */
    CAT_AL_ERROR = 0x10,              /* the device reports an error */
    CAT_AL_OP = 8
};

#endif
