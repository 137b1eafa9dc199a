/** One chart: uPlot draws the axes and the grid, `traces.ts` the samples. */

import uPlot from "uplot";
import { Envelope, envelope, range } from "./decimation.ts";
import type { RingStore } from "./store.ts";
import { COLOURS, dash, drawCursor, drawGaps, drawLevel, drawTrace } from "./traces.ts";
import { tickText, ValueRange, type Span } from "./view.ts";

export interface PlotTrace {
  signal: string;
  unit: string;
  colour: number; // index in the palette
}

/** What a chart shows in one frame. */
export interface Scene {
  store: RingStore;
  span: Span;
  origin: number; // time that the axis shows as 0 [s]
  cursors: readonly (number | null)[];
  trigger: { signal: string; level: number } | null;
  fine: boolean; // one group for each pixel; otherwise the plot may use wider groups
}

interface Palette {
  traces: string[];
  text: string;
  grid: string;
  gap: string;
  cursor: string;
}

const AXIS_SIZE = 58; // [px]
const SLOW = 3; // [ms]
const FAST = 1; // [ms]
const EMPTY: uPlot.AlignedData = [[0, 1]];

export class Plot {
  readonly canvas: uPlot;
  /** Mean script time of a drawing [ms]. */
  cost = 0;
  private traces: PlotTrace[] = [];
  private units: string[] = [];
  private readonly ranges = new Map<string, ValueRange>();
  private readonly envelopes: Envelope[] = [];
  private scene: Scene | null = null;
  private palette: Palette;
  private coarseness = 1; // pixels for each group

  constructor(private readonly element: HTMLElement, units: string[]) {
    this.units = units;
    this.palette = palette(element);
    this.canvas = new uPlot(this.options(), EMPTY, element);
  }

  setTraces(traces: PlotTrace[]): void {
    this.traces = traces;
    while (this.envelopes.length < traces.length) this.envelopes.push(new Envelope());
  }

  resize(width: number, height: number): void {
    this.canvas.setSize({ width, height });
  }

  destroy(): void {
    this.canvas.destroy();
  }

  /** Forget the ranges of values, so that the next frame fits them. */
  fit(): void {
    this.ranges.clear();
  }

  /** Draw one frame. */
  draw(scene: Scene): void {
    const begin = performance.now();
    this.scene = scene;
    this.decimate(scene);
    const { start, end } = scene.span;
    this.canvas.batch(() => {
      this.canvas.setScale("x", { min: start - scene.origin, max: end - scene.origin });
      for (const unit of this.units) {
        const { low, high } = this.rangeOf(unit);
        if (!Number.isNaN(low)) this.canvas.setScale(scaleKey(unit), { min: low, max: high });
      }
    });
    this.cost += 0.2 * (performance.now() - begin - this.cost);
    this.adapt();
  }

  /** Return the time at a horizontal position inside the plotting area [CSS px]. */
  timeAt(x: number, span: Span): number {
    const width = this.canvas.bbox.width / devicePixelRatio;
    return span.start + (x / width) * (span.end - span.start);
  }

  private rangeOf(unit: string): ValueRange {
    const known = this.ranges.get(unit);
    if (known !== undefined) return known;
    const fresh = new ValueRange();
    this.ranges.set(unit, fresh);
    return fresh;
  }

  private decimate({ store, span, fine }: Scene): void {
    const from = Math.max(store.begin, store.rowAt(span.start) - 1);
    const to = Math.min(store.end, store.rowAt(span.end) + 1);
    const groups = this.canvas.bbox.width / devicePixelRatio / (fine ? 1 : this.coarseness);
    this.traces.forEach((trace, index) => {
      const column = store.columns.get(trace.signal);
      const out = this.envelopes[index]!;
      out.count = 0;
      if (column === undefined || to <= from) return;
      envelope(store, column, from, to, Math.max(groups, 50), out);
      const [low, high] = range(out);
      this.rangeOf(trace.unit).include(low, high);
    });
  }

  private adapt(): void {
    if (this.cost > SLOW && this.coarseness < 4) this.coarseness *= 2;
    else if (this.cost < FAST && this.coarseness > 1) this.coarseness /= 2;
  }

  private paint(): void {
    const { scene } = this;
    if (scene === null) return;
    const context = this.canvas.ctx;
    const area = this.canvas.bbox;
    const ratio = devicePixelRatio;
    context.save();
    context.beginPath();
    context.rect(area.left, area.top, area.width, area.height);
    context.clip();
    context.fillStyle = this.palette.gap;
    drawGaps(context, area, scene.store, scene.span, ratio);
    this.paintTraces(context, scene, ratio);
    this.paintMarks(context, scene, ratio);
    context.restore();
  }

  private paintTraces(context: CanvasRenderingContext2D, scene: Scene, ratio: number): void {
    context.lineWidth = 1.25 * ratio;
    context.lineJoin = "bevel";
    this.traces.forEach((trace, index) => {
      const scale = this.rangeOf(trace.unit);
      context.strokeStyle = this.palette.traces[trace.colour % COLOURS]!;
      context.setLineDash(dash(trace.colour).map((length) => length * ratio));
      drawTrace(context, this.canvas.bbox, scene.store, this.envelopes[index]!, scene.span, scale);
    });
  }

  private paintMarks(context: CanvasRenderingContext2D, scene: Scene, ratio: number): void {
    const area = this.canvas.bbox;
    context.lineWidth = ratio;
    context.strokeStyle = context.fillStyle = this.palette.cursor;
    context.font = `${11 * ratio}px system-ui, sans-serif`;
    context.setLineDash([]);
    scene.cursors.forEach((time, index) => {
      if (time !== null) drawCursor(context, area, scene.span, time, "AB"[index]!, ratio);
    });
    const triggered = this.traces.find((trace) => trace.signal === scene.trigger?.signal);
    if (scene.trigger === null || triggered === undefined) return;
    context.setLineDash([4 * ratio, 4 * ratio]);
    drawLevel(context, area, this.rangeOf(triggered.unit), scene.trigger.level);
  }

  private options(): uPlot.Options {
    const scales: uPlot.Scales = { x: { time: false, auto: false } };
    for (const unit of this.units) scales[scaleKey(unit)] = { auto: false };
    return {
      width: Math.max(this.element.clientWidth, 100),
      height: Math.max(this.element.clientHeight, 100),
      scales,
      series: [{}],
      axes: [this.timeAxis(), ...this.units.slice(0, 2).map((unit, index) => this.valueAxis(unit, index))],
      legend: { show: false },
      cursor: { drag: { x: false, y: false }, points: { show: false }, x: true, y: true },
      padding: [10, this.units.length > 1 ? 0 : 14, 0, this.units.length > 0 ? 0 : AXIS_SIZE],
      hooks: { draw: [() => this.paint()] },
    };
  }

  private timeAxis(): uPlot.Axis {
    const { text, grid } = this.palette;
    return {
      values: tickTexts, stroke: text, grid: { stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1, size: 4 },
      font: "11px system-ui, sans-serif", size: 26, gap: 3,
    };
  }

  private valueAxis(unit: string, index: number): uPlot.Axis {
    const { text, grid } = this.palette;
    return {
      values: tickTexts, space: 22, scale: scaleKey(unit), side: index === 0 ? 3 : 1, stroke: text, size: AXIS_SIZE, gap: 3,
      grid: { show: index === 0, stroke: grid, width: 1 }, ticks: { stroke: grid, width: 1, size: 4 },
      font: "11px system-ui, sans-serif", label: unit || "1", labelSize: 16, labelFont: "11px system-ui, sans-serif",
    };
  }
}

function tickTexts(_plot: uPlot, ticks: number[]): string[] {
  const step = ticks.length > 1 ? ticks[1]! - ticks[0]! : 1;
  return ticks.map((tick) => tickText(tick, step));
}

function scaleKey(unit: string): string {
  return `y:${unit}`;
}

function palette(element: HTMLElement): Palette {
  const style = getComputedStyle(element);
  const colour = (name: string): string => style.getPropertyValue(name).trim();
  return {
    traces: Array.from({ length: COLOURS }, (_, index) => colour(`--trace-${index}`)),
    text: colour("--scope-text"),
    grid: colour("--scope-grid"),
    gap: colour("--scope-gap"),
    cursor: colour("--scope-cursor"),
  };
}
