"""CANopen over EtherCAT on the device side: dictionary, SDO server, information, PDO objects."""
