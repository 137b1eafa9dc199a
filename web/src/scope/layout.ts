/** Arrangement of the scope: charts, traces, trigger. It is kept in the browser, one for each share. */

import type { Group } from "./catalog.ts";
import type { TriggerSettings } from "./trigger.ts";

export const MAX_TRACES = 32;
export const MAX_CHARTS = 8;
export const WINDOWS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60]; // [s]

export interface ChartLayout {
  id: number;
  traces: string[];
}

export interface ScopeLayout {
  charts: ChartLayout[];
  recorded: string[]; // signals in the store that no chart shows
  window: number; // [s]
  trigger: TriggerSettings;
  triggerOn: boolean;
}

/** Return the first arrangement: two quantities of the first axis. */
export function defaultLayout(groups: Group[]): ScopeLayout {
  const first = (field: string): string[] => {
    const id = groups.find((group) => group.field === field)?.signals[0]?.id;
    return id === undefined ? [] : [id];
  };
  const traces = [
    [...first("commanded_position"), ...first("position")],
    first("velocity"),
  ].filter((each) => each.length > 0);
  const charts = traces.length > 0 ? traces : [groups[0]?.signals.slice(0, 1).map((s) => s.id) ?? []];
  return {
    charts: charts.map((each, index) => ({ id: index + 1, traces: each })),
    recorded: [],
    window: 5,
    trigger: { signal: "", level: 0, edge: "rising", mode: "auto", pre: 0.25, window: 5 },
    triggerOn: false,
  };
}

/** Return all signals that the store keeps. */
export function signalsOf(layout: ScopeLayout): string[] {
  return [...new Set([...layout.charts.flatMap((chart) => chart.traces), ...layout.recorded])];
}

export function traceCount(layout: ScopeLayout): number {
  return layout.charts.reduce((sum, chart) => sum + chart.traces.length, 0);
}

/** Show or hide a signal in one chart. The signal stays in the store. */
export function toggled(layout: ScopeLayout, chart: number, signal: string): ScopeLayout {
  const shown = layout.charts.find((each) => each.id === chart)?.traces.includes(signal) ?? false;
  if (!shown && traceCount(layout) >= MAX_TRACES) return layout;
  const charts = layout.charts.map((each) => {
    if (each.id !== chart) return each;
    const traces = shown ? each.traces.filter((id) => id !== signal) : [...each.traces, signal];
    return { ...each, traces };
  });
  const recorded = shown ? [...new Set([...layout.recorded, signal])] : layout.recorded;
  return { ...layout, charts, recorded };
}

/** Keep signals in the store, or forget those that no chart shows. */
export function recording(layout: ScopeLayout, signals: string[], on: boolean): ScopeLayout {
  const others = layout.recorded.filter((id) => !signals.includes(id));
  return { ...layout, recorded: on ? [...others, ...signals] : others };
}

export function withChart(layout: ScopeLayout): ScopeLayout {
  if (layout.charts.length >= MAX_CHARTS) return layout;
  const id = Math.max(0, ...layout.charts.map((chart) => chart.id)) + 1;
  return { ...layout, charts: [...layout.charts, { id, traces: [] }] };
}

export function withoutChart(layout: ScopeLayout, chart: number): ScopeLayout {
  return { ...layout, charts: layout.charts.filter((each) => each.id !== chart) };
}

/** Read a stored arrangement. Return null if it is not one. */
export function parseLayout(text: string | null): ScopeLayout | null {
  try {
    const value = JSON.parse(text ?? "null") as ScopeLayout | null;
    return value !== null && isLayout(value) ? value : null;
  } catch {
    return null;
  }
}

function isLayout(value: ScopeLayout): boolean {
  const { charts, recorded, window, trigger } = value;
  return Array.isArray(charts) && charts.length <= MAX_CHARTS && charts.every(isChart) &&
    traceCount(value) <= MAX_TRACES && isNames(recorded) &&
    WINDOWS.includes(window) && isTrigger(trigger) && typeof value.triggerOn === "boolean";
}

function isChart(chart: ChartLayout): boolean {
  return Number.isInteger(chart?.id) && isNames(chart.traces);
}

function isNames(value: unknown): boolean {
  return Array.isArray(value) && value.every((each) => typeof each === "string");
}

function isTrigger(value: TriggerSettings): boolean {
  return typeof value?.signal === "string" && [value.level, value.pre, value.window].every(Number.isFinite) &&
    ["rising", "falling", "either"].includes(value.edge) && ["auto", "normal", "single"].includes(value.mode);
}
