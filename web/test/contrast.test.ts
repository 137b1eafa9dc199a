import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

// The tests run in the folder of package.json.
const css = readFileSync("src/styles/theme.css", "utf8");
const TEXT = 4.5; // WCAG 2.2, 1.4.3
const GRAPHICS = 3; // WCAG 2.2, 1.4.11

/** Pairs of text and background. */
const TEXTS: readonly (readonly [string, string])[] = [
  ...["page", "surface", "raised", "sunken", "accent-soft"].flatMap(
    (ground) => [["text", ground], ["muted", ground]] as const,
  ),
  ...["accent", "ok", "warn", "bad"].flatMap(
    (tone) => [[tone, "surface"], [tone, "raised"], [tone, `${tone}-soft`]] as const,
  ),
  ["accent", "page"],
  ["on-accent", "accent"],
  ["on-stop", "stop"],
  ["on-stop", "stop-pressed"],
];

/** Pairs of a control or mark and its background. */
const MARKS: readonly (readonly [string, string])[] = [
  ["line-strong", "surface"],
  ["line-strong", "page"],
  ["line-strong", "sunken"],
  ["focus", "surface"],
  ["focus", "page"],
  ["accent", "sunken"],
  ["bad", "sunken"],
  ["stop", "surface"],
];

for (const [theme, selector] of [["light", ":root {"], ["dark", ':root[data-theme="dark"] {']] as const) {
  const colours = coloursOf(selector);
  for (const [pairs, least] of [[TEXTS, TEXT], [MARKS, GRAPHICS]] as const) {
    for (const [front, back] of pairs) {
      test(`${theme}: ${front} on ${back}`, () => {
        const found = contrast(colour(colours, front), colour(colours, back));
        assert.ok(found >= least, `contrast ${found.toFixed(2)} is less than ${least}`);
      });
    }
  }
}

test("both themes define the same colours", () => {
  const dark = [...coloursOf(':root[data-theme="dark"] {').keys()];
  assert.deepEqual([...coloursOf(":root {").keys()], dark);
});

function coloursOf(selector: string): Map<string, string> {
  const start = css.indexOf(selector);
  assert.notEqual(start, -1);
  const block = css.slice(start, css.indexOf("}", start));
  return new Map([...block.matchAll(/--([\w-]+):\s*(#[0-9a-f]{6});/g)].map((m) => [m[1] ?? "", m[2] ?? ""]));
}

function colour(colours: Map<string, string>, name: string): string {
  const found = colours.get(name);
  assert.ok(found, `no colour ${name}`);
  return found;
}

/** Contrast ratio, WCAG 2.2. */
function contrast(a: string, b: string): number {
  const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y) as [number, number];
  return (high + 0.05) / (low + 0.05);
}

function luminance(hex: string): number {
  const [r, g, b] = [1, 3, 5].map((at) => {
    const c = parseInt(hex.slice(at, at + 2), 16) / 255;
    return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  }) as [number, number, number];
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
