/** Files that the scope exports: the visible charts as an image, the samples as CSV or MCAP. */

import type { SignalInfo } from "./catalog.ts";
import { encodeCsv, encodeMcap, type Table } from "./export.ts";
import type { RingStore } from "./store.ts";
import type { Span } from "./view.ts";

/** Return the samples of the signals in a span as a table. */
export function tableOf(store: RingStore, signals: SignalInfo[], span: Span): Table {
  const from = store.rowAt(span.start);
  const to = store.rowAt(span.end + store.period / 2);
  return {
    topic: "/scope",
    names: signals.map((each) => each.label),
    units: signals.map((each) => each.unit),
    rows: Math.max(0, to - from),
    time: (row) => store.timeOf(from + row),
    value: (signal, row) => store.value(signals[signal]!.id, from + row),
  };
}

export function saveCsv(table: Table): void {
  save(new Blob([encodeCsv(table)], { type: "text/csv" }), "scope.csv");
}

export function saveMcap(table: Table, utcOffset: number): void {
  save(new Blob([encodeMcap(table, BigInt(Math.round(utcOffset)))]), "scope.mcap");
}

/** Save canvases, one below the other, each with a line of text. */
export function savePng(parts: { canvas: HTMLCanvasElement; caption: string }[], style: CSSStyleDeclaration): void {
  const ratio = devicePixelRatio;
  const line = 22 * ratio;
  const image = document.createElement("canvas");
  image.width = Math.max(1, ...parts.map((part) => part.canvas.width));
  image.height = parts.reduce((sum, part) => sum + part.canvas.height + line, 0);
  const context = image.getContext("2d")!;
  context.fillStyle = style.getPropertyValue("--scope-background").trim();
  context.fillRect(0, 0, image.width, image.height);
  context.fillStyle = style.getPropertyValue("--scope-text").trim();
  context.font = `${12 * ratio}px system-ui, sans-serif`;
  let y = 0;
  for (const { canvas, caption } of parts) {
    context.fillText(caption, 8 * ratio, y + 16 * ratio, image.width - 16 * ratio);
    context.drawImage(canvas, 0, y + line);
    y += line + canvas.height;
  }
  image.toBlob((blob) => blob !== null && save(blob, "scope.png"));
}

function save(blob: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
