/** Axes: values against limits, states, and jogs. */

import { useComputed, useSignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { isPhone } from "../media.ts";
import { OperationPanel } from "../operation/panel.tsx";
import { Segmented } from "../parts/common.tsx";
import { confirmed } from "../parts/confirm.tsx";
import type { AxisInfo } from "../remote.ts";
import { ScenePanel } from "../scene/panel.tsx";
import { useResource } from "../resource.ts";
import { text } from "../strings.ts";
import { AxisCard } from "./axes/card.tsx";
import { Jogging, type StepSize, type Unit } from "./axes/jogging.ts";

const STEP_SIZES: readonly StepSize[] = ["hold", "small", "medium", "large"];

export function Axes({ connection }: { connection: Connection }) {
  const jogging = useMemo(() => new Jogging(connection), [connection]);
  useEffect(() => jogging.attach(), [jogging]);
  const infos = useResource<AxisInfo[]>(connection, "axes").value.value ?? [];
  const layout = connection.hello.value?.layout;
  const names = layout?.axes ?? [];
  const noJog = connection.hello.value?.reason_no_jog ?? null;
  const common = layout?.fields.find(({ name }) => name === "position")?.unit;
  const kinds = new Set(infos.map(({ unit }) => unit));
  const units = kinds.size > 1 ? "both" : kinds.has("m") ? "m" : "rad";
  if (names.length === 0) return <p class="empty">{text.axes.none}</p>;
  return (
    <>
      <OperationPanel connection={connection} />
      <Toolbar {...{ connection, jogging, noJog, units }} />
      {!isPhone.value && <ScenePanel connection={connection} />}
      <div class="axes-grid">
        {names.map((name, axis) => {
          const info = infos.find((each) => each.name === name);
          const unit: Unit = info?.unit ?? (common === "m" ? "m" : "rad");
          return (
            <AxisCard key={name} {...{ connection, jogging, axis, name, info, unit, noJog }} />
          );
        })}
      </div>
      {isPhone.value && <ScenePanel connection={connection} />}
      {noJog === null && connection.role.value === "operator" && <EnablePad jogging={jogging} />}
    </>
  );
}

interface ToolbarProps {
  connection: Connection;
  jogging: Jogging;
  noJog: string | null;
  units: Unit | "both";
}

function Toolbar({ connection, jogging, noJog, units }: ToolbarProps) {
  return (
    <div class="panel toolbar">
      {noJog === null ? (
        <>
          <label class="row">
            <span>{text.jog.speed}</span>
            <input
              type="range"
              min={1}
              max={100}
              value={jogging.speed.value}
              aria-valuetext={`${jogging.speed.value} %`}
              onInput={(event) => (jogging.speed.value = Number(event.currentTarget.value))}
            />
            <span class="mono percent">{jogging.speed.value} %</span>
          </label>
          <Segmented
            label={text.jog.step}
            options={STEP_SIZES.map((size) => [size, text.jog.steps[units][size]])}
            value={jogging.step.value}
            onChange={(step) => (jogging.step.value = step)}
          />
          <p class="muted small grow toolbar-hint">{text.jog.hint}</p>
        </>
      ) : (
        <p class="muted grow">
          {text.jog.impossible} {noJog}
        </p>
      )}
      <AllAxes connection={connection} />
    </div>
  );
}

function AllAxes({ connection }: { connection: Connection }) {
  const faults = useComputed(() => connection.status.value?.axes.some(({ fault }) => fault !== ""));
  const operator = connection.role.value === "operator";
  const enable = async () => {
    const question = {
      title: text.axes.enableAll,
      body: text.axes.enableBody,
      action: text.axes.enableAll,
    };
    if (await confirmed(question)) connection.request(null, "enable");
  };
  return (
    <div class="row wrap">
      <button type="button" class="button small" disabled={!operator} onClick={() => void enable()}>
        {text.axes.enableAll}
      </button>
      <button
        type="button"
        class="button small"
        disabled={!operator}
        onClick={() => connection.request(null, "disable")}
      >
        {text.axes.disableAll}
      </button>
      <button
        type="button"
        class="button small"
        disabled={!operator || !faults.value}
        onClick={() => connection.request(null, "reset")}
      >
        {text.axes.resetAll}
      </button>
    </div>
  );
}

/** Second touch of a jog on a touch screen. */
function EnablePad({ jogging }: { jogging: Jogging }) {
  const touched = useSignal(matchMedia("(pointer: coarse)").matches);
  useEffect(() => {
    const onPointer = (event: PointerEvent) => {
      if (event.pointerType !== "mouse") touched.value = true;
    };
    window.addEventListener("pointerdown", onPointer);
    return () => window.removeEventListener("pointerdown", onPointer);
  }, []);
  if (!touched.value) return null;
  const end = () => jogging.enable(false);
  return (
    <button
      type="button"
      class={jogging.enabling.value ? "enable-pad held" : "enable-pad"}
      aria-pressed={jogging.enabling.value}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        jogging.enable(true);
      }}
      onPointerUp={end}
      onPointerCancel={end}
      onLostPointerCapture={end}
      onContextMenu={(event) => event.preventDefault()}
    >
      {text.jog.enablePad}
      <small>{text.jog.enablePadHint}</small>
    </button>
  );
}
