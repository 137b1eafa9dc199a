/** Card of one axis: values against limits, state, and its controls. */

import { useComputed } from "@preact/signals";
import type { Connection } from "../../connection.ts";
import { shortened } from "../../logic/format.ts";
import { positionRange, signedRange } from "../../logic/range.ts";
import { notifyError } from "../../notices.ts";
import { Chip } from "../../parts/common.tsx";
import { confirmed } from "../../parts/confirm.tsx";
import type { AxisInfo } from "../../remote.ts";
import { address } from "../../route.ts";
import { text } from "../../strings.ts";
import { Bar } from "./bar.tsx";
import { JogControls } from "./jog_controls.tsx";
import type { Jogging, Unit } from "./jogging.ts";
import { AxisState, EnableButton, useIsPowered } from "./power.tsx";

export interface CardProps {
  connection: Connection;
  jogging: Jogging;
  axis: number;
  name: string;
  info: AxisInfo | undefined;
  unit: Unit;
  noJog: string | null; // why this session cannot jog
}

export function AxisCard(props: CardProps) {
  const { connection, axis, name, info } = props;
  return (
    <section class="panel axis" aria-label={name}>
      <header>
        <h2 class="two-lines grow" title={name}>
          {shortened(name)}
        </h2>
        <AxisState connection={connection} axis={axis} />
      </header>
      <div class="body">
        <p class="row small muted">
          {info !== undefined && (
            <>
              <span>
                {text.axes.mode} {text.axes.modes[info.mode] ?? info.mode}
              </span>
              <a href={address("devices", info.device)}>
                {text.axes.device} {info.device}
              </a>
            </>
          )}
          <Jogged connection={connection} axis={axis} />
        </p>
        <Bars {...props} />
        <Trouble connection={connection} axis={axis} />
        <Controls {...props} />
      </div>
    </section>
  );
}

function Jogged({ connection, axis }: { connection: Connection; axis: number }) {
  const jogged = useComputed(() => connection.status.value?.axes[axis]?.jogged ?? false);
  return jogged.value ? <Chip tone="info">{text.axes.jogged}</Chip> : null;
}

function Bars({ connection, axis, info, unit }: CardProps) {
  const read = (key: "position" | "velocity" | "torque" | "commanded_position") => () =>
    connection.status.value?.axes[axis]?.[key] ?? null;
  const force = unit === "rad" ? "N·m" : "N";
  return (
    <div class="live">
      <Bar
        label={text.axes.position}
        unit={unit}
        read={read("position")}
        target={read("commanded_position")}
        range={(value) =>
          positionRange(info?.position_min, info?.position_max, value, unit === "rad" ? Math.PI : 0.1)
        }
        centred={false}
      />
      <Bar
        label={text.axes.velocity}
        unit={`${unit}/s`}
        read={read("velocity")}
        range={(value) => signedRange(info?.velocity_limit, value, unit === "rad" ? 1 : 0.05)}
        centred
      />
      <Bar
        label={unit === "rad" ? text.axes.torque : text.axes.force}
        unit={force}
        read={read("torque")}
        range={(value) => signedRange(info?.torque_limit, value, 1)}
        centred
      />
    </div>
  );
}

/** Fault and stop reason, if there are any. */
function Trouble({ connection, axis }: { connection: Connection; axis: number }) {
  const fault = useComputed(() => connection.status.value?.axes[axis]?.fault ?? "");
  const reason = useComputed(() => connection.status.value?.axes[axis]?.stop_reason ?? "");
  return (
    <div class="trouble" role="status">
      {fault.value !== "" && (
        <p class="bad-text">
          {text.axes.fault}: {fault.value}
        </p>
      )}
      {reason.value !== "" && (
        <p class="muted">
          {text.axes.stopped}: {reason.value}
        </p>
      )}
    </div>
  );
}

function Controls(props: CardProps) {
  const { connection, jogging, axis, noJog } = props;
  const enabled = useIsPowered(connection, axis);
  const faulted = useComputed(() => (connection.status.value?.axes[axis]?.fault ?? "") !== "");
  const operator = connection.role.value === "operator";
  const answer = jogging.answers.value.get(axis);
  return (
    <>
      <div class="row wrap">
        <EnableButton {...props} enabled={enabled} faulted={faulted.value} disabled={!operator} />
        <button
          type="button"
          class={faulted.value ? "button small primary" : "button small"}
          disabled={!operator || !faulted.value}
          onClick={() => connection.request([axis], "reset")}
        >
          {text.axes.reset}
        </button>
        <HomeButton {...props} disabled={!operator || !enabled} />
      </div>
      <JogControls {...props} disabled={!operator || noJog !== null || !enabled} />
      <p class={isRefused(answer?.status) ? "answer bad-text" : "answer muted"} role="status">
        {answer?.text ?? ""}
      </p>
    </>
  );
}

function HomeButton({ connection, name, disabled }: CardProps & { disabled: boolean }) {
  const onClick = async () => {
    const question = {
      title: `${text.axes.home} ${name}?`,
      body: text.axes.homeBody,
      action: text.axes.home,
    };
    if (await confirmed(question)) await connection.call("home", { axes: [name] }).catch(notifyError);
  };
  return (
    <button
      type="button"
      class="button small"
      disabled={disabled}
      onClick={() => void onClick()}
    >
      {text.axes.home}
    </button>
  );
}

function isRefused(status: string | undefined): boolean {
  return status !== undefined && (status.startsWith("REFUSED") || status === "EXPIRED");
}
