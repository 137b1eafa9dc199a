/** Address of the shown view: #/devices/3. */

import { computed, signal } from "@preact/signals";

const fragment = signal(location.hash);
window.addEventListener("hashchange", () => (fragment.value = location.hash));

/** Parts of the address: ["devices", "3"]. */
export const route = computed(() =>
  fragment.value
    .replace(/^#\/?/, "")
    .split("/")
    .map((part) => safely(part)),
);

export function address(...parts: (string | number)[]): string {
  return `#/${parts.map((part) => encodeURIComponent(part)).join("/")}`;
}

function safely(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
