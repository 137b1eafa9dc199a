import catenary as cat

with cat.MainDevice("eth0") as main:
    sub = main.scan()[3]
    print(sub.pdos)  # table: PDO, object, name, type, bit offset
    raw = cat.ProcessData(sub)  # as mapped now; nothing is written to the device
    word = 0
    with cat.Loop(raw, period=2e-3) as loop:
        for cycle in loop:
            raw.outputs[0:2] = (cycle.number & 0xFFFF).to_bytes(2, "little")
            word = int.from_bytes(raw.inputs[4:6], "little")
            if cycle.time > 5.0:
                break
    print(word)
