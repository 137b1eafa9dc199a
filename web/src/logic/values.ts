/** Values of objects as text: parsing and checking what a user enters. */

export interface ValueType {
  type: string; // EtherCAT base type, such as "UDINT" or "UNSIGNED32"
  bits: number;
  minimum?: number | null;
  maximum?: number | null;
}

export type Parsed =
  | { value: number | boolean | string; error: null }
  | { value: null; error: "integer" | "number" | "boolean" | "hex" | "range" | "long" | "exact" };

export type Family = "boolean" | "signed" | "unsigned" | "real" | "text" | "bytes";

const SIGNED = /^(SINT|INT|DINT|LINT|INT(EGER)?\d+)$/;
const UNSIGNED = /^(USINT|UINT|UDINT|ULINT|BYTE|WORD|DWORD|LWORD|BIT\d+|BITARR\d+|UINT\d+|UNSIGNED\d+)$/;
const REAL = /^(REAL|LREAL|REAL32|REAL64|FLOAT)$/;
const TEXT = /^(VISIBLE_STRING|UNICODE_STRING|STRING)/;

/** Return the family of a type; types that are not known count as bytes. */
export function familyOf(type: string): Family {
  if (/^(BOOL|BOOLEAN|BIT)$/.test(type)) return "boolean";
  if (SIGNED.test(type)) return "signed";
  if (UNSIGNED.test(type)) return "unsigned";
  if (REAL.test(type)) return "real";
  return TEXT.test(type) ? "text" : "bytes";
}

/** Parse what a user entered for an object, and check its range. */
export function parseValue(entered: string, type: ValueType): Parsed {
  const text = entered.trim().replace(/^[−–]/, "-");
  switch (familyOf(type.type)) {
    case "boolean":
      return parseBoolean(text);
    case "signed":
      return parseInteger(text, type, true);
    case "unsigned":
      return parseInteger(text, type, false);
    case "real":
      return parseReal(text, type);
    case "text":
      return parseText(entered, type);
    case "bytes":
      return parseBytes(text, type);
  }
}

/** Return the range of an integer type as text: "0 to 255". */
export function rangeOf(type: ValueType): string | null {
  const family = familyOf(type.type);
  if (family !== "signed" && family !== "unsigned") {
    const known = type.minimum != null && type.maximum != null;
    return known ? `${type.minimum} to ${type.maximum}` : null;
  }
  const [low, high] = limits(type, family === "signed");
  return `${low} to ${high}`;
}

function failed(error: NonNullable<Parsed["error"]>): Parsed {
  return { value: null, error };
}

function parseBoolean(text: string): Parsed {
  const value = { "0": false, "false": false, "1": true, "true": true }[text.toLowerCase()];
  return value === undefined ? failed("boolean") : { value, error: null };
}

function parseInteger(text: string, type: ValueType, signed: boolean): Parsed {
  const match = /^(-?)(0x[0-9a-f]+|0b[01]+|\d+)$/i.exec(text);
  if (match === null) return failed("integer");
  const size = BigInt(match[2] as string);
  const number = match[1] === "-" ? -size : size;
  const [low, high] = limits(type, signed);
  if (number < low || number > high) return failed("range");
  const value = Number(number);
  return Number.isSafeInteger(value) ? { value, error: null } : failed("exact");
}

/** Return the smallest and largest integer of a type, within the limits of the object. */
function limits(type: ValueType, signed: boolean): [bigint, bigint] {
  const bits = BigInt(type.bits);
  const own = signed ? [-(1n << (bits - 1n)), (1n << (bits - 1n)) - 1n] : [0n, (1n << bits) - 1n];
  const [low, high] = own as [bigint, bigint];
  const minimum = type.minimum == null ? low : BigInt(Math.ceil(type.minimum));
  const maximum = type.maximum == null ? high : BigInt(Math.floor(type.maximum));
  return [minimum > low ? minimum : low, maximum < high ? maximum : high];
}

function parseReal(text: string, type: ValueType): Parsed {
  const value = Number(text.replace(",", "."));
  if (text === "" || !Number.isFinite(value)) return failed("number");
  if (type.minimum != null && value < type.minimum) return failed("range");
  if (type.maximum != null && value > type.maximum) return failed("range");
  return { value, error: null };
}

function parseText(text: string, type: ValueType): Parsed {
  const size = new TextEncoder().encode(text).length;
  return type.bits > 0 && size > type.bits / 8 ? failed("long") : { value: text, error: null };
}

/** Bytes are entered as hexadecimal digits, and sent as such: "01 02 FF" → "0102ff". */
function parseBytes(text: string, type: ValueType): Parsed {
  const digits = text.replace(/^0x/i, "").replace(/[\s:]/g, "").toLowerCase();
  if (digits.length % 2 === 1 || !/^[0-9a-f]*$/.test(digits)) return failed("hex");
  if (type.bits > 0 && digits.length / 2 > type.bits / 8) return failed("long");
  return { value: digits, error: null };
}
