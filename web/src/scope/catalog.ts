/** Signals that the share offers, and the search in them. */

import type { Field, Layout } from "../protocol.ts";

export interface SignalInfo {
  id: string; // as in a subscription: "position[0]"
  field: string;
  label: string; // "position · shoulder"
  unit: string;
}

export interface Group {
  field: string;
  unit: string;
  signals: SignalInfo[];
}

/** Return the fields of a share, each with one signal per element. */
export function catalog(layout: Layout): Group[] {
  return layout.fields.map((field) => ({
    field: field.name,
    unit: field.unit,
    signals: elements(field, layout.axes),
  }));
}

function elements(field: Field, axes: string[]): SignalInfo[] {
  const count = field.shape.reduce((product, size) => product * size, 1);
  if (field.shape.length === 0) return [info(field, field.name, field.name)];
  return Array.from({ length: count }, (_, index) => {
    const name = field.per_axis ? (axes[index] ?? `${index}`) : `${index}`;
    return info(field, `${field.name}[${index}]`, `${field.name} · ${name}`);
  });
}

function info(field: Field, id: string, label: string): SignalInfo {
  return { id, field: field.name, label, unit: field.unit };
}

/** Return the groups with only the signals that contain each word of the query. */
export function search(groups: Group[], query: string): Group[] {
  const words = query.toLowerCase().split(/\s+/).filter(Boolean);
  if (words.length === 0) return groups;
  return groups
    .map((group) => ({ ...group, signals: group.signals.filter((each) => matches(each, words)) }))
    .filter((group) => group.signals.length > 0);
}

function matches(signal: SignalInfo, words: string[]): boolean {
  const text = `${signal.label} ${signal.id} ${signal.unit}`.toLowerCase();
  return words.every((word) => text.includes(word));
}
