/** State of the scope view. It lives as long as the page, so that other views interrupt no record. */

import { computed, effect, signal } from "@preact/signals";
import type { Connection } from "../connection.ts";
import { Acquisition, HISTORY } from "./acquisition.ts";
import { catalog, type Group, type SignalInfo } from "./catalog.ts";
import { defaultLayout, parseLayout, signalsOf, type ScopeLayout } from "./layout.ts";
import { measure, type Measurement } from "./measurements.ts";
import type { Plot, Scene } from "./plot.ts";
import type { RingStore } from "./store.ts";
import { Trigger, type TriggerState } from "./trigger.ts";
import { TimeView, type Span } from "./view.ts";

const BUDGET = 3; // [ms] of drawing in one frame; further charts follow in the next frame

export interface MeasuredRow {
  signal: string;
  show: (value: number, measurement: Measurement, at: readonly [number, number]) => void;
}

/** Owns layout, time range, trigger, cursors and the plots on the screen. */
export class ScopeModel {
  readonly acquisition: Acquisition;
  readonly layout = signal<ScopeLayout | null>(null);
  readonly active = signal(1); // chart that receives signals of the picker
  readonly following = signal(true);
  readonly cursors = signal<readonly [number | null, number | null]>([null, null]);
  readonly triggerState = signal<TriggerState | null>(null);
  readonly lost = signal(0);
  readonly groups = computed<Group[]>(() => {
    const hello = this.connection.hello.value;
    return hello === null ? [] : catalog(hello.layout);
  });
  readonly signals = computed(() => {
    const all = this.groups.value.flatMap((group) => group.signals);
    return new Map<string, SignalInfo>(all.map((each) => [each.id, each]));
  });
  readonly plots = new Map<number, Plot>();
  readonly rows = new Map<string, MeasuredRow>();
  private readonly view = new TimeView(5);
  private trigger: Trigger | null = null;
  private captured: { span: Span; origin: number } | null = null;
  private nextPlot = 0;
  private pending = 0; // charts to draw until the screen shows the newest state
  private nextRow = 0;
  private drawn = -1;
  private frames = 0;

  constructor(private readonly connection: Connection) {
    this.acquisition = new Acquisition(connection);
    effect(() => this.open());
    effect(() => this.renew(this.acquisition.generation.value));
  }

  get store(): RingStore {
    return this.acquisition.store;
  }

  get span(): Span {
    return this.captured?.span ?? this.view.span(this.store.lastTime);
  }

  /** Time that the axis shows as 0 [s]: the trigger, or the second in which the run began. */
  get origin(): number {
    if (this.captured !== null) return this.captured.origin;
    return this.store.end === 0 ? 0 : Math.floor(this.store.timeOf(this.store.begin) / 1000) * 1000;
  }

  /** Add to the cycle clock to get UTC [ns]. */
  get utcOffset(): number {
    return this.connection.hello.peek()?.layout.utc_offset_ns ?? 0;
  }

  change(layout: ScopeLayout): void {
    const before = this.layout.peek();
    this.layout.value = layout;
    localStorage.setItem(this.key(), JSON.stringify(layout));
    this.acquisition.record(signalsOf(layout));
    if (before?.trigger !== layout.trigger || before.triggerOn !== layout.triggerOn) this.arm();
    if (before?.window !== layout.window) this.live();
    this.redraw();
  }

  /** Search for the next trigger, and record again. */
  arm(): void {
    const layout = this.layout.peek();
    if (layout === null) return;
    this.acquisition.paused.value = false;
    this.view.follow();
    this.following.value = true;
    this.captured = null;
    this.trigger = layout.triggerOn
      ? new Trigger({ ...layout.trigger, window: layout.window }, this.store)
      : null;
    this.triggerState.value = this.trigger?.state ?? null;
  }

  /** Stop recording, and keep what the screen shows. */
  pause(): void {
    this.view.fixed = this.span;
    this.acquisition.paused.value = true;
    this.following.value = false;
    this.redraw();
  }

  /** Record, and show the newest samples. */
  live(): void {
    this.acquisition.paused.value = false;
    this.view.window = this.layout.peek()?.window ?? 5;
    this.view.follow();
    this.captured = null;
    this.following.value = true;
    if (this.trigger?.state === "complete") this.arm();
    this.redraw();
  }

  zoom(factor: number, centre: number): void {
    this.hold();
    this.view.zoom(this.span, factor, centre, this.store.period, HISTORY);
    this.redraw();
  }

  show(span: Span): void {
    const length = Math.max(span.end - span.start, 10 * this.store.period);
    this.hold();
    this.view.fixed = { start: span.start, end: span.start + length };
    this.redraw();
  }

  pan(seconds: number): void {
    this.hold();
    this.view.pan(this.span, seconds);
    this.redraw();
  }

  setCursor(index: 0 | 1, time: number | null): void {
    const [a, b] = this.cursors.peek();
    this.cursors.value = index === 0 ? [time, b] : [a, time];
    this.redraw();
  }

  toggleCursors(): void {
    const { start, end } = this.span;
    const on = this.cursors.peek()[0] === null;
    this.cursors.value = on ? [start + (end - start) / 3, end - (end - start) / 3] : [null, null];
    if (on) this.hold();
    this.redraw();
  }

  redraw(): void {
    this.drawn = -1;
  }

  /** Draw one frame of the screen within the budget. */
  frame(): void {
    const begin = performance.now();
    const { store } = this;
    this.lost.value = store.lost;
    if (!this.acquisition.paused.peek()) this.search();
    if (store.end !== this.drawn) {
      this.drawn = store.end;
      this.pending = this.plots.size;
    }
    this.drawPlots(begin);
    this.frames++;
    if (performance.now() - begin < BUDGET || this.frames % 4 === 0) this.measureRow();
  }

  private open(): void {
    const hello = this.connection.hello.value;
    if (hello === null || this.layout.peek() !== null) return;
    const layout = parseLayout(localStorage.getItem(this.key())) ?? defaultLayout(this.groups.peek());
    this.active.value = layout.charts[0]?.id ?? 1;
    this.change(layout);
  }

  private renew(_generation: number): void {
    this.cursors.value = [null, null];
    this.arm();
    this.redraw();
  }

  private key(): string {
    return `catenary.scope.${this.connection.hello.peek()?.share ?? ""}`;
  }

  private hold(): void {
    if (this.acquisition.paused.peek()) return;
    this.pause();
  }

  private search(): void {
    if (this.trigger === null) return;
    if (this.trigger.step(this.store)) this.capture(this.trigger);
    if (this.trigger.state === "free") this.captured = null;
    this.triggerState.value = this.trigger.state;
  }

  private capture(trigger: Trigger): void {
    const { start, end, trigger: origin } = trigger.capture!;
    this.captured = { span: { start, end }, origin };
    this.redraw();
    if (trigger.state !== "complete") return;
    this.acquisition.paused.value = true;
    this.view.fixed = { start, end };
    this.following.value = false;
  }

  private drawPlots(begin: number): void {
    const plots = [...this.plots.values()];
    const scene = this.scene();
    while (this.pending > 0 && plots.length > 0) {
      plots[this.nextPlot++ % plots.length]!.draw(scene);
      this.pending--;
      const next = plots[this.nextPlot % plots.length]!.cost;
      if (performance.now() - begin + next > BUDGET) break;
    }
  }

  private scene(): Scene {
    const layout = this.layout.peek();
    return {
      store: this.store,
      span: this.span,
      origin: this.origin,
      cursors: this.cursors.peek(),
      trigger: layout?.triggerOn ? layout.trigger : null,
      fine: this.acquisition.paused.peek(),
    };
  }

  private measureRow(): void {
    const rows = [...this.rows.values()];
    if (rows.length === 0 || this.store.end === 0) return;
    const row = rows[this.nextRow++ % rows.length]!;
    const { store, span } = this;
    const [a, b] = this.cursors.peek();
    const between = a !== null && b !== null;
    const from = store.rowAt(between ? Math.min(a, b) : span.start);
    const to = store.rowAt(between ? Math.max(a, b) : span.end);
    const result = measure(store, row.signal, from, to);
    row.show(store.value(row.signal, store.end - 1), result, [this.valueAt(row.signal, a), this.valueAt(row.signal, b)]);
  }

  private valueAt(name: string, time: number | null): number {
    if (time === null) return NaN;
    return this.store.value(name, Math.min(this.store.rowAt(time), this.store.end - 1));
  }
}

const models = new WeakMap<Connection, ScopeModel>();

/** Return the model that belongs to a connection. */
export function modelOf(connection: Connection): ScopeModel {
  const known = models.get(connection) ?? new ScopeModel(connection);
  models.set(connection, known);
  return known;
}
