/** Width of the screen as the style sheets distinguish it. */

import { signal, type ReadonlySignal } from "@preact/signals";

/** True while a media query matches. */
function matches(query: string): ReadonlySignal<boolean> {
  const list = matchMedia(query);
  const found = signal(list.matches);
  list.addEventListener("change", () => (found.value = list.matches));
  return found;
}

export const isPhone = matches("(max-width: 720px)");
export const isWide = matches("(min-width: 981px)"); // a list and its detail fit side by side
