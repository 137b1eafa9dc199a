/** Short messages at the edge of the page. */

import { signal } from "@preact/signals";
import { RemoteError } from "./connection.ts";

export interface Notice {
  id: number;
  kind: "info" | "bad";
  message: string;
  hint: string;
}

const LIFETIME = { info: 4000, bad: 12000 }; // [ms]
const KEPT = 4;
let next = 1;

export const notices = signal<readonly Notice[]>([]);

export function notify(message: string, { hint = "", kind = "info" as Notice["kind"] } = {}): void {
  const same = notices.value.find((each) => each.message === message && each.hint === hint);
  if (same !== undefined) return;
  const id = next++;
  notices.value = [...notices.value, { id, kind, message, hint }].slice(-KEPT);
  setTimeout(() => dismiss(id), LIFETIME[kind]);
}

/** Show an error of a call, with its hint. */
export function notifyError(error: unknown): void {
  const hint = error instanceof RemoteError ? error.hint : "";
  notify(error instanceof Error ? error.message : String(error), { hint, kind: "bad" });
}

export function dismiss(id: number): void {
  notices.value = notices.value.filter((each) => each.id !== id);
}
