"""CANopen over EtherCAT on the device side: dictionary, SDO servers and PDO objects."""
