/** Panel with the operating mode, and buttons that request modes and presets while they are held. */

import { useSignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { Hold } from "../logic/hold.ts";
import { Chip, Panel, type Tone } from "../parts/common.tsx";
import type { Choice } from "../protocol.ts";
import { text } from "../strings.ts";
import { HoldButton } from "./hold_button.tsx";
import { OperationRequests, type Kind, type Outcome, type Report, type Target } from "./requests.ts";

const TONES: Record<Outcome, Tone> = {
  requested: "info",
  accepted: "ok",
  refused: "warn",
  unanswered: "bad",
  failed: "bad",
};

/** Show the operating mode of the program; nothing if the program offers no modes and presets. */
export function OperationPanel({ connection }: { connection: Connection }) {
  const requests = useMemo(() => new OperationRequests(connection), [connection]);
  const hello = connection.hello.value;
  const modes = hello?.modes ?? [];
  const presets = hello?.presets ?? [];
  const held = useSignal<Target | null>(null);
  const hold = useMemo(() => {
    const made: Hold<Target> = new Hold(
      (target) => void requests.request(target),
      () => (held.value = made.held),
    );
    return made;
  }, [requests]);
  useEffect(() => endOnInterruption(connection, hold), [connection, hold, hello?.run]);
  useEffect(() => forgetWithTheConnection(connection, requests), [connection, requests, hello?.run]);
  if (modes.length + presets.length === 0) return null;
  const operator = connection.role.value === "operator";
  const ready =
    connection.state.value === "open" && connection.status.value !== null && connection.running.value;
  const group = { hold, held: held.value, disabled: !operator || !ready || requests.waits };
  const mode = connection.mode.value;
  const state = <Chip tone={mode === null ? "" : "info"}>{mode ?? text.operation.unknown}</Chip>;
  return (
    <Panel title={text.operation.title} actions={state} class="operation">
      <div class="body">
        <Choices {...group} kind="mode" label={text.operation.modes} choices={modes} current={mode} />
        <Choices {...group} kind="preset" label={text.operation.presets} choices={presets} />
        <Result report={requests.report.value} hint={operator ? text.operation.hint : text.operation.viewer} />
      </div>
    </Panel>
  );
}

/** End a hold when the page loses the focus or the connection, and with a stop. Return the end of this. */
function endOnInterruption(connection: Connection, hold: Hold<Target>): () => void {
  const end = () => hold.end();
  const kinds = ["blur", "pagehide"] as const;
  for (const kind of kinds) window.addEventListener(kind, end);
  document.addEventListener("visibilitychange", end);
  const ends = [connection.stops.subscribe(end), connection.state.subscribe(end)];
  return () => {
    end();
    for (const kind of kinds) window.removeEventListener(kind, end);
    document.removeEventListener("visibilitychange", end);
    for (const each of ends) each();
  };
}

/** Forget the report at the end of a run, and give up a request whose connection ends. */
function forgetWithTheConnection(connection: Connection, requests: OperationRequests): () => void {
  const end = connection.state.subscribe((state) => state !== "open" && requests.interrupt());
  return () => {
    end();
    requests.forget();
  };
}

interface ChoicesProps {
  hold: Hold<Target>;
  held: Target | null;
  disabled: boolean;
  kind: Kind;
  label: string;
  choices: readonly Choice[];
  current?: string | null;
}

function Choices({ hold, held, disabled, kind, label, choices, current }: ChoicesProps) {
  if (choices.length === 0) return null;
  return (
    <div class="choices" role="group" aria-label={label}>
      <h3>{label}</h3>
      <div class="row wrap">
        {choices.map(({ name, description }) => (
          <HoldButton
            key={name}
            hold={hold}
            target={{ kind, name }}
            held={held?.kind === kind && held.name === name}
            current={kind === "mode" ? current === name : undefined}
            description={description}
            disabled={disabled}
          />
        ))}
      </div>
    </div>
  );
}

/** Answer to the last request; a hint before the first. */
function Result({ report, hint }: { report: Report | null; hint: string }) {
  return (
    <p class="operation-result" role="status">
      {report === null ? (
        <span class="small muted">{hint}</span>
      ) : (
        <>
          <Chip tone={TONES[report.outcome]}>{text.operation.outcomes[report.outcome]}</Chip>{" "}
          {text.operation.kinds[report.kind]} {report.name}
          {report.reason !== "" && `: ${report.reason}`}
        </>
      )}
    </p>
  );
}
