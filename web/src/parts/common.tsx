/** Small parts that several views use. */

import type { ComponentChildren } from "preact";
import { text } from "../strings.ts";

export type Tone = "" | "ok" | "warn" | "bad" | "info";

export function Chip({ tone = "", children }: { tone?: Tone; children: ComponentChildren }) {
  return <span class={`chip ${tone}`}>{children}</span>;
}

/** Text that changes with the signals that `of` reads, without rendering its surroundings again. */
export function LiveText({ of }: { of: () => string }) {
  return <>{of()}</>;
}

export function Icon({ path }: { path: string }) {
  return (
    <svg class="icon" viewBox="0 0 24 24" aria-hidden="true">
      <path d={path} />
    </svg>
  );
}

export function Panel(props: {
  title: string;
  actions?: ComponentChildren;
  class?: string;
  children?: ComponentChildren;
}) {
  return (
    <section class={`panel ${props.class ?? ""}`} aria-label={props.title}>
      <header>
        <h2>{props.title}</h2>
        <div class="row wrap right">{props.actions}</div>
      </header>
      {props.children}
    </section>
  );
}

export function Failure({ error }: { error: Error | null }) {
  if (error === null) return null;
  return (
    <p class="empty" role="status">
      {text.common.unavailable} {error.message}
    </p>
  );
}

export function Segmented<T extends string>(props: {
  label: string;
  options: readonly (readonly [T, string])[];
  value: T;
  onChange: (value: T) => void;
}) {
  return (
    <div class="segmented" role="group" aria-label={props.label}>
      {props.options.map(([value, label]) => (
        <button
          key={value}
          type="button"
          aria-pressed={value === props.value}
          onClick={() => props.onChange(value)}
        >
          {label}
        </button>
      ))}
    </div>
  );
}
