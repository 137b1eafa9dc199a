/** Numbers as text. */

export const MISSING = "–";
const MINUS = "−";
const SPACE = "\u00a0"; // does not break a line

const TIME_UNITS: readonly [number, string][] = [
  [1, "s"],
  [1e-3, "ms"],
  [1e-6, "µs"],
  [1e-9, "ns"],
];

/** Digits after the point of live values, by unit. */
const DIGITS: { readonly [unit: string]: number } = {
  rad: 4,
  m: 5,
  "rad/s": 3,
  "m/s": 4,
  "N·m": 3,
  N: 2,
};

/** Return a number with a fixed count of digits, or a dash if there is none. */
export function fixed(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || Number.isNaN(value)) return MISSING;
  if (!Number.isFinite(value)) return value > 0 ? "∞" : `${MINUS}∞`;
  const text = Math.abs(value).toFixed(digits);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/** Return a live value with the digits of its unit. */
export function quantity(value: number | null | undefined, unit: string): string {
  return fixed(value, DIGITS[unit] ?? 3);
}

/** Return a time [s] with three significant digits: 0.0000123 → "12.3 µs". */
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || Number.isNaN(seconds)) return MISSING;
  if (seconds === 0) return `0${SPACE}s`;
  const size = Math.abs(seconds);
  const found = TIME_UNITS.find(([factor]) => size >= factor * 0.9995) ?? TIME_UNITS[3];
  const [factor, unit] = found as [number, string];
  const scaled = size / factor;
  const digits = unit === "ns" ? 0 : Math.max(0, 2 - Math.floor(Math.log10(scaled * 1.0005)));
  return `${seconds < 0 ? MINUS : ""}${scaled.toFixed(digits)}${SPACE}${unit}`;
}

/** Return an integer with groups of three digits. */
export function count(value: number | null | undefined): string {
  if (value === null || value === undefined) return MISSING;
  return Math.round(value)
    .toString()
    .replace(/\B(?=(\d{3})+$)/g, SPACE);
}

/** Return an integer as hexadecimal: "0x6064". */
export function hex(value: number, digits: number): string {
  return `0x${value.toString(16).toUpperCase().padStart(digits, "0")}`;
}

/** Return the index and subindex of an object entry: "0x6064:00". */
export function objectKey(index: number, subindex: number): string {
  return `${hex(index, 4)}:${subindex.toString(16).toUpperCase().padStart(2, "0")}`;
}

/** Return the time of day of a UTC time [s]: "14:03:12.512". */
export function timeOfDay(utc: number): string {
  const date = new Date(utc * 1000);
  if (Number.isNaN(date.getTime())) return MISSING;
  const parts = [date.getHours(), date.getMinutes(), date.getSeconds()];
  const clock = parts.map((each) => String(each).padStart(2, "0")).join(":");
  return `${clock}.${String(date.getMilliseconds()).padStart(3, "0")}`;
}

/** Return a name of at most `most` characters: a longer one without its middle. */
export function shortened(name: string, most = 44): string {
  if (name.length <= most) return name;
  const end = Math.floor((most - 1) / 2);
  return `${name.slice(0, most - 1 - end)}…${name.slice(-end)}`;
}
