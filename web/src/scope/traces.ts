/** Drawing of traces, gaps and cursors into the canvas of a chart. */

import type { Envelope } from "./decimation.ts";
import type { RingStore } from "./store.ts";
import type { Span } from "./view.ts";

export interface Area {
  left: number;
  top: number;
  width: number;
  height: number;
}

const DASHES: number[][] = [[], [7, 3], [2, 3], [9, 3, 2, 3]];
export const COLOURS = 8;

/** Return the dash pattern of a trace. Colours repeat after eight traces, patterns then differ. */
export function dash(index: number): number[] {
  return DASHES[Math.floor(index / COLOURS) % DASHES.length]!;
}

/** Draw the envelope of one signal between `low` and `high` of its scale. */
export function drawTrace(
  context: CanvasRenderingContext2D, area: Area, store: RingStore, out: Envelope, span: Span,
  scale: { low: number; high: number },
): void {
  const perSecond = area.width / (span.end - span.start);
  const perUnit = area.height / (scale.high - scale.low);
  const { begin, end } = store;
  const floor = area.top + area.height;
  const exit = (out.step - 1) * store.period * perSecond; // a group ends at its last row
  let connected = false;
  let last = 0;
  context.beginPath();
  for (let index = 0; index < out.count; index++) {
    const low = out.low[index]!;
    const high = out.high[index]!;
    if (low > high) {
      connected = false;
      continue;
    }
    const row = out.first + index * out.step;
    const shown = row < begin ? begin : row >= end ? end - 1 : row;
    const x = area.left + (store.timeOf(shown) - span.start) * perSecond;
    const bottom = floor - (low - scale.low) * perUnit;
    const top = floor - (high - scale.low) * perUnit;
    const upFirst = Math.abs(top - last) < Math.abs(bottom - last);
    last = upFirst ? bottom : top;
    const near = upFirst ? top : bottom;
    if (connected) context.lineTo(x, near);
    else context.moveTo(x, near);
    if (bottom - top > 0.5 || !connected) context.lineTo(x + exit, last);
    connected = true;
  }
  context.stroke();
}

/** Shade the intervals without samples; each is at least two pixels wide. */
export function drawGaps(
  context: CanvasRenderingContext2D, area: Area, store: RingStore, span: Span, ratio: number,
): void {
  const perSecond = area.width / (span.end - span.start);
  for (const gap of store.gaps) {
    if (gap.row <= store.begin || gap.row + 1 >= store.end) continue;
    const start = store.timeOf(gap.row - 1);
    const end = store.timeOf(gap.row + 1);
    if (end < span.start || start > span.end) continue;
    const x = area.left + (start - span.start) * perSecond;
    context.fillRect(x, area.top, Math.max(2 * ratio, (end - start) * perSecond), area.height);
  }
}

/** Draw a vertical line with a letter at a time. */
export function drawCursor(
  context: CanvasRenderingContext2D, area: Area, span: Span, time: number, label: string, ratio: number,
): void {
  const x = area.left + ((time - span.start) * area.width) / (span.end - span.start);
  if (x < area.left || x > area.left + area.width) return;
  context.beginPath();
  context.moveTo(x, area.top);
  context.lineTo(x, area.top + area.height);
  context.stroke();
  context.fillText(label, x + 4 * ratio, area.top + 12 * ratio);
}

/** Draw the trigger level as a horizontal line. */
export function drawLevel(
  context: CanvasRenderingContext2D, area: Area, scale: { low: number; high: number }, level: number,
): void {
  const y = area.top + area.height * (1 - (level - scale.low) / (scale.high - scale.low));
  if (y < area.top || y > area.top + area.height) return;
  context.beginPath();
  context.moveTo(area.left, y);
  context.lineTo(area.left + area.width, y);
  context.stroke();
}

