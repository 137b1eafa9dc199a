/** The most important numbers of the loop. */

import type { Connection } from "../../connection.ts";
import { isPowered } from "../../logic/axis_state.ts";
import { count, duration } from "../../logic/format.ts";
import { LiveText } from "../../parts/common.tsx";
import type { Device } from "../../remote.ts";
import { text } from "../../strings.ts";

export function Summary({ connection, devices }: { connection: Connection; devices: Device[] | null }) {
  const operational = devices?.filter(({ state }) => state === "OP").length ?? 0;
  const axes = () => connection.status.value?.axes ?? [];
  const counters = () => connection.timing.value?.counters ?? {};
  const lateness = () => connection.timing.value?.figures["lateness"];
  const faults = () => axes().filter(({ fault }) => fault !== "").length;
  const t = text.overview;
  return (
    <dl class="tiles live">
      <Tile label={t.cycles} of={() => count(connection.status.value?.number)} />
      <Tile label={t.period} of={() => duration(connection.hello.value?.layout.period)} />
      <Tile label={t.lateness} of={() => duration(lateness()?.p99)} />
      <Tile label={t.worst} of={() => duration(lateness()?.max)} />
      <Tile label={t.lost} of={() => count(counters()["lost"])} bad={() => !!counters()["lost"]} />
      <Tile label={t.skipped} of={() => count(counters()["late"])} />
      <Tile
        label={t.devices}
        of={() => (devices === null ? count(null) : `${operational} / ${devices.length}`)}
        bad={() => devices !== null && operational < devices.length}
      />
      <Tile
        label={t.axes}
        of={() => `${axes().filter(isPowered).length} / ${axes().length}`}
      />
      <Tile label={t.faults} of={() => String(faults())} bad={() => faults() > 0} />
    </dl>
  );
}

function Tile({ label, of, bad }: { label: string; of: () => string; bad?: () => boolean }) {
  return (
    <div class="tile">
      <dt>{label}</dt>
      <dd class={bad?.() ? "bad-text" : ""}>
        <LiveText of={of} />
      </dd>
    </div>
  );
}
