"""Files of virtual devices: the server of FoE (ETG.1000.6 §5.8), the stored files, the firmware."""
