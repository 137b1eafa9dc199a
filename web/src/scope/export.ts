/** Exported files: CSV, and MCAP (version 0, https://mcap.dev/spec) with one JSON channel, without chunks and index. */

const MAGIC = Uint8Array.of(0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a);
const HEADER = 0x01;
const FOOTER = 0x02;
const SCHEMA = 0x03;
const CHANNEL = 0x04;
const MESSAGE = 0x05;
const DATA_END = 0x0f;
const SCHEMA_ID = 1;
const CHANNEL_ID = 1;
const PAGE = 1 << 20; // bytes

const encoder = new TextEncoder();

/** Growing buffer of little-endian values. */
class Writer {
  private buffer = new Uint8Array(PAGE);
  private view = new DataView(this.buffer.buffer);
  private size = 0;

  u8(value: number): void {
    this.reserve(1);
    this.view.setUint8(this.size, value);
    this.size += 1;
  }

  u16(value: number): void {
    this.reserve(2);
    this.view.setUint16(this.size, value, true);
    this.size += 2;
  }

  u32(value: number): void {
    this.reserve(4);
    this.view.setUint32(this.size, value, true);
    this.size += 4;
  }

  u64(value: bigint): void {
    this.reserve(8);
    this.view.setBigUint64(this.size, value, true);
    this.size += 8;
  }

  bytes(data: Uint8Array): void {
    this.reserve(data.length);
    this.buffer.set(data, this.size);
    this.size += data.length;
  }

  string(text: string): void {
    const data = encoder.encode(text);
    this.u32(data.length);
    this.bytes(data);
  }

  /** Write one record; its length is the number of bytes that `content` writes. */
  record(opcode: number, content: () => void): void {
    this.u8(opcode);
    this.u64(0n);
    const start = this.size;
    content();
    this.view.setBigUint64(start - 8, BigInt(this.size - start), true);
  }

  result(): Uint8Array<ArrayBuffer> {
    return this.buffer.slice(0, this.size);
  }

  private reserve(more: number): void {
    if (this.size + more <= this.buffer.length) return;
    const larger = new Uint8Array(2 * (this.size + more));
    larger.set(this.buffer.subarray(0, this.size));
    this.buffer = larger;
    this.view = new DataView(larger.buffer);
  }
}

export interface Table {
  topic: string;
  names: string[];
  units: string[];
  rows: number;
  time: (row: number) => number; // [s]
  value: (signal: number, row: number) => number; // NaN: missing
}

/** Encode a table as MCAP. `utcOffset` [ns] converts the cycle clock to UTC. */
export function encodeMcap(table: Table, utcOffset: bigint): Uint8Array<ArrayBuffer> {
  const writer = new Writer();
  writer.bytes(MAGIC);
  writer.record(HEADER, () => {
    writer.string("");
    writer.string("catenary dashboard");
  });
  writeSchema(writer, table);
  writeChannel(writer, table);
  for (let row = 0; row < table.rows; row++) writeMessage(writer, table, row, utcOffset);
  writer.record(DATA_END, () => writer.u32(0));
  writer.record(FOOTER, () => {
    writer.u64(0n);
    writer.u64(0n);
    writer.u32(0);
  });
  writer.bytes(MAGIC);
  return writer.result();
}

function writeSchema(writer: Writer, table: Table): void {
  const properties: Record<string, object> = {
    time: { type: "number", description: "cycle start on the cycle clock [s]" },
  };
  table.names.forEach((name, index) => {
    const unit = table.units[index];
    properties[name] = { type: ["number", "null"], ...(unit ? { description: `[${unit}]` } : {}) };
  });
  writer.record(SCHEMA, () => {
    writer.u16(SCHEMA_ID);
    writer.string("catenary.Scope");
    writer.string("jsonschema");
    writer.string(JSON.stringify({ type: "object", properties }));
  });
}

function writeChannel(writer: Writer, table: Table): void {
  writer.record(CHANNEL, () => {
    writer.u16(CHANNEL_ID);
    writer.u16(SCHEMA_ID);
    writer.string(table.topic);
    writer.string("json");
    writer.u32(0); // no metadata
  });
}

function writeMessage(writer: Writer, table: Table, row: number, utcOffset: bigint): void {
  const seconds = table.time(row);
  const stamp = BigInt(Math.round(seconds * 1e9)) + utcOffset;
  const message: Record<string, number | null> = { time: seconds };
  table.names.forEach((name, signal) => {
    const value = table.value(signal, row);
    message[name] = Number.isFinite(value) ? value : null;
  });
  writer.record(MESSAGE, () => {
    writer.u16(CHANNEL_ID);
    writer.u32(row);
    writer.u64(stamp);
    writer.u64(stamp);
    writer.bytes(encoder.encode(JSON.stringify(message)));
  });
}

/** Encode a table as CSV: one line per row, missing values empty. */
export function encodeCsv(table: Table): string {
  const units = table.names.map((name, index) => heading(name, table.units[index] ?? ""));
  const lines = [["time [s]", ...units].join(",")];
  for (let row = 0; row < table.rows; row++) {
    const cells = table.names.map((_, signal) => cell(table.value(signal, row)));
    lines.push([table.time(row).toFixed(9), ...cells].join(","));
  }
  return lines.join("\n") + "\n";
}

function cell(value: number): string {
  return Number.isNaN(value) ? "" : String(value);
}

/** Return a quoted heading. A leading apostrophe keeps spreadsheets from running a formula. */
function heading(name: string, unit: string): string {
  const text = unit === "" ? name : `${name} [${unit}]`;
  const safe = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return `"${safe.replaceAll('"', '""')}"`;
}
