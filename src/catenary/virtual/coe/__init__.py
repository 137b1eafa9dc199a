"""CANopen over EtherCAT, the device's side: dictionary, SDO server, information, PDO objects."""
