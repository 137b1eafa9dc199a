/** Bar of a live value against its limits. */

import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { fixed, quantity } from "../../logic/format.ts";
import { fraction, type Range } from "../../logic/range.ts";
import { LiveText } from "../../parts/common.tsx";
import { text } from "../../strings.ts";

const NEAR = 0.9; // share of a limit from which the bar warns

export interface BarProps {
  label: string;
  unit: string;
  read: () => number | null; // reads signals
  range: (value: number) => Range;
  target?: () => number | null;
  centred: boolean; // true: the bar begins at zero; false: a marker shows the value
}

export function Bar(props: BarProps) {
  const { label, unit, read } = props;
  return (
    <div class="quantity">
      <span class="quantity-label">{label}</span>
      <Track {...props} />
      <span class="quantity-value mono">
        <LiveText of={() => quantity(read(), unit)} />
        <span class="quantity-unit">{unit}</span>
      </span>
    </div>
  );
}

function Track({ label, unit, read, range, target, centred }: BarProps) {
  const track = useRef<HTMLDivElement>(null);
  const fill = useRef<HTMLDivElement>(null);
  const tick = useRef<HTMLDivElement>(null);
  const low = useRef<HTMLSpanElement>(null);
  const high = useRef<HTMLSpanElement>(null);
  const draw = () => {
    const value = read();
    const goal = target?.() ?? null;
    if (track.current === null || fill.current === null) return;
    const span = range(value ?? 0);
    drawFill(fill.current, value, span, centred);
    drawTick(tick.current, goal, span);
    describe(track.current, value, span, unit);
    write(low.current, limitText(span, span.low));
    write(high.current, limitText(span, span.high));
  };
  useEffect(() => effect(draw)); // after each rendering, because the limits may be new
  return (
    <div class="track-box">
    <div
      ref={track}
      class={centred ? "track centred" : "track"}
      role="meter"
      aria-label={label}
      aria-valuemin={0}
      aria-valuemax={1}
    >
      <div ref={fill} class="fill" />
      {target !== undefined && <div ref={tick} class="tick" />}
    </div>
    <div class="track-ends" aria-hidden="true"><span ref={low} /><span ref={high} /></div>
    </div>
  );
}

function drawFill(element: HTMLElement, value: number | null, span: Range, centred: boolean): void {
  element.hidden = value === null;
  if (value === null) return;
  const at = fraction(value, span);
  const from = centred ? Math.min(at, 0.5) : at;
  element.style.left = percent(from);
  element.style.width = centred ? percent(Math.abs(at - 0.5)) : "";
  const edge = Math.abs(at - 0.5) * 2;
  element.classList.toggle("near", span.limited && edge >= NEAR);
}

function drawTick(element: HTMLElement | null, value: number | null, span: Range): void {
  if (element === null) return;
  element.hidden = value === null;
  if (value !== null) element.style.left = percent(fraction(value, span));
}

function describe(element: HTMLElement, value: number | null, span: Range, unit: string): void {
  element.classList.toggle("unlimited", !span.limited);
  element.ariaValueMin = String(span.low);
  element.ariaValueMax = String(span.high);
  element.ariaValueNow = String(value ?? 0);
  element.ariaValueText = value === null ? text.common.unknown : `${quantity(value, unit)} ${unit}`;
  const limits = `${quantity(span.low, unit)} … ${quantity(span.high, unit)} ${unit}`;
  element.title = span.limited ? limits : `${limits} (${text.axes.noLimit})`;
}

/** Return an end of a bar as text; brackets: it is not a limit. */
function limitText(span: Range, end: number): string {
  const text = fixed(end, Math.abs(end) < 1 ? 3 : Math.abs(end) < 100 ? 2 : 0);
  return span.limited ? text : `(${text})`;
}

function write(element: HTMLElement | null, text: string): void {
  if (element !== null && element.textContent !== text) element.textContent = text;
}

function percent(share: number): string {
  return `${(100 * share).toFixed(2)}%`;
}
