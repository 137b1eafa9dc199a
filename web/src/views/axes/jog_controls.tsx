/** Controls of a jog: two buttons that are held, and the arrow keys. */

import { useComputed } from "@preact/signals";
import type { Connection } from "../../connection.ts";
import { fixed } from "../../logic/format.ts";
import type { AxisInfo } from "../../remote.ts";
import { text } from "../../strings.ts";
import { speedOf, type Jogging, type Unit } from "./jogging.ts";

export interface JogControlsProps {
  connection: Connection;
  jogging: Jogging;
  axis: number;
  name: string;
  info: AxisInfo | undefined;
  unit: Unit;
  disabled: boolean;
}

const KEYS: Readonly<Record<string, 1 | -1>> = {
  ArrowLeft: -1,
  ArrowDown: -1,
  ArrowRight: 1,
  ArrowUp: 1,
};

export function JogControls(props: JogControlsProps) {
  const { jogging, axis, name, info, unit, disabled } = props;
  const begin = (sign: 1 | -1, touch: boolean) => {
    if (!disabled) jogging.press(axis, sign, jogging.request(info, unit, sign), touch);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const sign = KEYS[event.key];
    if (sign === undefined || event.altKey || event.ctrlKey || event.metaKey) {
      jogging.release(); // with such a key held, some systems do not report that the arrow key goes up
      return;
    }
    event.preventDefault();
    if (!event.repeat) begin(sign, false);
  };
  const onFocusOut = (event: FocusEvent) => {
    const group = event.currentTarget as HTMLElement;
    if (!group.contains(event.relatedTarget as Node | null)) jogging.release();
  };
  return (
    <div
      class="jog"
      role="group"
      aria-label={`${text.jog.label} ${name}. ${text.jog.keys}`}
      aria-disabled={disabled}
      tabIndex={disabled ? -1 : 0}
      onKeyDown={onKeyDown}
      onKeyUp={(event) => event.key in KEYS && jogging.release()}
      onFocusOut={onFocusOut}
    >
      <JogButton {...props} sign={-1} begin={begin} />
      <Speed jogging={jogging} info={info} unit={unit} />
      <JogButton {...props} sign={1} begin={begin} />
    </div>
  );
}

function Speed({ jogging, info, unit }: { jogging: Jogging; info: AxisInfo | undefined; unit: Unit }) {
  return (
    <span class="jog-speed mono">
      {fixed(speedOf(info, unit, jogging.speed.value), 3)} {unit}/s
    </span>
  );
}

/** Return true if only another button of the mouse is still down; there is no pointerup for the first. */
export function isOtherButton(event: PointerEvent): boolean {
  const button = event.currentTarget as HTMLElement;
  return (event.buttons & 1) === 0 && button.hasPointerCapture(event.pointerId);
}

interface JogButtonProps extends JogControlsProps {
  sign: 1 | -1;
  begin: (sign: 1 | -1, touch: boolean) => void;
}

function JogButton({ jogging, axis, name, disabled, sign, begin }: JogButtonProps) {
  const held = useComputed(
    () => jogging.held.value?.axis === axis && jogging.held.value.sign === sign,
  );
  const release = () => jogging.release();
  const onPointerDown = (event: PointerEvent) => {
    if (event.button !== 0 || disabled) return;
    const button = event.currentTarget as HTMLButtonElement;
    button.setPointerCapture(event.pointerId);
    begin(sign, event.pointerType !== "mouse");
  };
  return (
    <button
      type="button"
      class={held.value ? "button jog-button held" : "button jog-button"}
      disabled={disabled}
      tabIndex={-1}
      aria-label={`${text.jog.label} ${name} ${sign > 0 ? text.jog.plus : text.jog.minus}`}
      aria-pressed={held.value}
      onPointerDown={onPointerDown}
      onPointerUp={release}
      onPointerMove={(event) => isOtherButton(event) && release()}
      onPointerCancel={release}
      onLostPointerCapture={release}
      onContextMenu={(event) => event.preventDefault()}
    >
      {sign > 0 ? "+" : "−"}
    </button>
  );
}
