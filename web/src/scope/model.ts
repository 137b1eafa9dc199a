/** State of the scope view. It lives as long as the page, so that other views interrupt no record. */

import { computed, effect, signal } from "@preact/signals";
import type { Connection } from "../connection.ts";
import { Acquisition, HISTORY } from "./acquisition.ts";
import { catalog, type Group } from "./catalog.ts";
import { ChartsModel } from "./charts_model.ts";
import { defaultLayout, parseLayout, signalsOf, type ScopeLayout } from "./layout.ts";
import type { Scene } from "./plot.ts";
import type { RingStore } from "./store.ts";
import { Trigger, type TriggerState } from "./trigger.ts";
import type { Span } from "./view.ts";

/** Owns the acquisition and the trigger. */
export class ScopeModel extends ChartsModel {
  readonly acquisition: Acquisition;
  readonly triggerState = signal<TriggerState | null>(null);
  readonly captures = signal(0);
  readonly lost = signal(0);
  readonly groups = computed<Group[]>(() => {
    const hello = this.connection.hello.value;
    return hello === null ? [] : catalog(hello.layout);
  });
  private trigger: Trigger | null = null;
  private captured: { span: Span; origin: number } | null = null;

  constructor(private readonly connection: Connection) {
    super();
    this.acquisition = new Acquisition(connection);
    effect(() => this.open());
    effect(() => this.renew(this.acquisition.generation.value));
  }

  get store(): RingStore {
    return this.acquisition.store;
  }

  get longest(): number {
    return HISTORY;
  }

  override get span(): Span {
    return this.view.fixed ?? this.captured?.span ?? this.view.span(this.store.lastTime);
  }

  /** Time that the axis shows as 0 [s]: the trigger, or a multiple of 1000 s. */
  get origin(): number {
    if (this.captured !== null) return this.captured.origin;
    return this.store.end === 0 ? 0 : Math.floor(this.store.timeOf(this.store.begin) / 1000) * 1000;
  }

  /** Add to the cycle clock to get UTC [ns]. */
  get utcOffset(): number {
    return this.connection.hello.peek()?.layout.utc_offset_ns ?? 0;
  }

  override change(layout: ScopeLayout): void {
    const before = this.layout.peek();
    super.change(layout);
    this.acquisition.record(signalsOf(layout));
    if (before?.trigger !== layout.trigger || before.triggerOn !== layout.triggerOn) this.arm();
    if (before?.window !== layout.window) this.live();
  }

  /** Search for the next trigger, and record again. */
  arm(): void {
    const layout = this.layout.peek();
    if (layout === null) return;
    this.acquisition.paused.value = false;
    this.view.follow();
    this.captured = null;
    this.captures.value = 0;
    this.trigger = layout.triggerOn
      ? new Trigger({ ...layout.trigger, window: layout.window }, this.store)
      : null;
    this.triggerState.value = this.trigger?.state ?? null;
  }

  /** Stop recording, and keep what the screen shows. */
  pause(): void {
    this.view.fixed = this.span;
    this.acquisition.paused.value = true;
    this.redraw();
  }

  /** Record, and show the newest samples or the next capture. */
  live(): void {
    this.view.window = this.layout.peek()?.window ?? 5;
    this.arm();
    this.redraw();
  }

  override frame(): void {
    this.lost.value = this.store.lost;
    if (!this.isStill()) this.search();
    super.frame();
  }

  protected isStill(): boolean {
    return this.acquisition.paused.peek();
  }

  protected key(): string {
    return `catenary.scope.${this.connection.hello.peek()?.share ?? ""}`;
  }

  protected override scene(): Scene {
    const layout = this.layout.peek();
    return { ...super.scene(), trigger: layout?.triggerOn ? layout.trigger : null };
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

  private search(): void {
    if (this.trigger === null) return;
    if (this.trigger.step(this.store)) this.capture(this.trigger);
    if (this.trigger.state === "free") this.captured = null;
    this.triggerState.value = this.trigger.state;
  }

  private capture(trigger: Trigger): void {
    const { start, end, trigger: origin } = trigger.capture!;
    this.captured = { span: { start, end }, origin };
    this.captures.value++;
    this.redraw();
    if (trigger.state === "complete") this.pause();
  }
}

const models = new WeakMap<Connection, ScopeModel>();

/** Return the model that belongs to a connection. */
export function modelOf(connection: Connection): ScopeModel {
  const known = models.get(connection) ?? new ScopeModel(connection);
  models.set(connection, known);
  return known;
}
