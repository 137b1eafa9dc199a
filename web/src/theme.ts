/** Light and dark: the choice of the user, or of the system. */

import { effect, signal } from "@preact/signals";

export type Choice = "system" | "light" | "dark";

const KEY = "catenary.theme";
const NEXT: Record<Choice, Choice> = { system: "light", light: "dark", dark: "system" };
const system = matchMedia("(prefers-color-scheme: dark)");
const systemIsDark = signal(system.matches);

export const choice = signal<Choice>(stored());

/** Apply the theme to the document from now on. Views may redraw on the event "themechange". */
export function applyTheme(): void {
  system.addEventListener("change", () => (systemIsDark.value = system.matches));
  effect(() => {
    const dark = choice.value === "system" ? systemIsDark.value : choice.value === "dark";
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    window.dispatchEvent(new CustomEvent("themechange"));
  });
}

export function nextTheme(): void {
  choice.value = NEXT[choice.value];
  localStorage.setItem(KEY, choice.value);
}

function stored(): Choice {
  const value = localStorage.getItem(KEY);
  return value === "light" || value === "dark" ? value : "system";
}
