"""SERCOS part of virtual drives: server of SoE (ETG.1000.6 §5.9), IDNs, telegrams, drive states."""
