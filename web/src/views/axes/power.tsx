/** State of an axis, and the button that enables and disables it. */

import { useComputed } from "@preact/signals";
import type { Connection } from "../../connection.ts";
import { isPowered } from "../../logic/axis_state.ts";
import { Chip, type Tone } from "../../parts/common.tsx";
import { confirmed } from "../../parts/confirm.tsx";
import type { AxisStatus } from "../../protocol.ts";
import { text } from "../../strings.ts";

const TONES: Readonly<Record<string, Tone>> = {
  OPERATION_ENABLED: "ok",
  QUICK_STOP_ACTIVE: "warn",
  FAULT_REACTION_ACTIVE: "bad",
  FAULT: "bad",
};

/** Return true while an axis is enabled. */
export function useIsPowered(connection: Connection, axis: number): boolean {
  return useComputed(() => {
    const status = connection.status.value?.axes[axis];
    return status !== undefined && isPowered(status);
  }).value;
}

export function AxisState({ connection, axis }: { connection: Connection; axis: number }) {
  const state = useComputed(() => connection.status.value?.axes[axis]?.state ?? "");
  return <Chip tone={TONES[state.value] ?? ""}>{readable(state.value)}</Chip>;
}

interface EnableProps {
  connection: Connection;
  axis: number;
  name: string;
  enabled: boolean;
  faulted: boolean;
  disabled: boolean;
}

export function EnableButton(props: EnableProps) {
  const { connection, axis, name, enabled, faulted, disabled } = props;
  const onClick = async () => {
    if (enabled) {
      connection.request([axis], "disable");
      return;
    }
    const question = {
      title: `${text.axes.enable} ${name}?`,
      body: text.axes.enableBody,
      action: text.axes.enable,
    };
    if (await confirmed(question)) connection.request([axis], "enable");
  };
  return (
    <button
      type="button"
      class={enabled || faulted ? "button small" : "button small primary"}
      disabled={disabled}
      onClick={() => void onClick()}
    >
      {enabled ? text.axes.disable : text.axes.enable}
    </button>
  );
}

/** Return a state as words: "OPERATION_ENABLED" → "Operation enabled". */
export function readable(state: AxisStatus["state"]): string {
  if (state === "") return text.common.unknown;
  return (state[0] ?? "") + state.slice(1).toLowerCase().replaceAll("_", " ");
}
