/** Header: connection, cycle, role, and the quick stop. */

import type { Connection, LinkState } from "./connection.ts";
import { count, duration } from "./logic/format.ts";
import { Icon, LiveText, type Tone } from "./parts/common.tsx";
import { StopButton } from "./stop.tsx";
import { text } from "./strings.ts";
import { choice, nextTheme } from "./theme.ts";

const THEME_ICON = "M12 3a9 9 0 1 0 0 18zM12 3a9 9 0 0 1 0 18";

const TONES: Record<LinkState, Tone> = {
  connecting: "warn",
  open: "ok",
  gone: "warn",
  lost: "bad",
  login: "warn",
};

export function Header({ connection }: { connection: Connection }) {
  return (
    <header class="head">
      <div class="brand">
        <img class="logo" src="/icon.svg" alt="" />
        <div class="grow">
          <h1 class="cut">{connection.hello.value?.share ?? text.name}</h1>
          <div class="small muted cut">{connection.hello.value?.program ?? ""}</div>
        </div>
      </div>
      <dl class="facts">
        <ConnectionFact connection={connection} />
        <LoopFact connection={connection} />
        <div>
          <dt>{text.header.cycle}</dt>
          <dd>
            <LiveText of={() => count(connection.status.value?.number)} />
          </dd>
        </div>
        <div class="optional">
          <dt>{text.header.lateness}</dt>
          <dd>
            <LiveText of={() => duration(connection.status.value?.lateness)} />
          </dd>
        </div>
        <RoleFact connection={connection} />
        <ModeFact connection={connection} />
      </dl>
      <ThemeButton />
      <StopButton connection={connection} />
    </header>
  );
}

function ConnectionFact({ connection }: { connection: Connection }) {
  const state = connection.state.value;
  return (
    <div>
      <dt>{text.header.connection}</dt>
      <dd>
        <span class={`dot ${TONES[state]}`} aria-hidden="true" />
        <span role="status">{text.connection[state]}</span>
      </dd>
    </div>
  );
}

function LoopFact({ connection }: { connection: Connection }) {
  const open = connection.state.value === "open" && connection.fresh.value;
  const lost = connection.losing.value;
  const tone: Tone = !open ? "" : !connection.running.value ? "bad" : lost ? "warn" : "ok";
  const shown: string = !open
    ? text.header.unknown
    : !connection.running.value
      ? text.header.stalled
      : lost
        ? text.header.losing
        : text.header.running;
  return (
    <div>
      <dt>{text.header.bus}</dt>
      <dd>
        <span class={`dot ${tone}`} aria-hidden="true" />
        {shown}
      </dd>
    </div>
  );
}

function RoleFact({ connection }: { connection: Connection }) {
  const role = connection.role.value;
  return (
    <div>
      <dt>{text.header.role}</dt>
      <dd>{role === null ? text.header.unknown : text.header.roles[role]}</dd>
    </div>
  );
}

/** Operating mode; nothing if the program has no modes. */
function ModeFact({ connection }: { connection: Connection }) {
  if ((connection.hello.value?.modes.length ?? 0) === 0) return null;
  return (
    <div class="mode">
      <dt>{text.header.mode}</dt>
      <dd class="cut">
        <LiveText of={() => connection.mode.value ?? text.operation.unknown} />
      </dd>
    </div>
  );
}

function ThemeButton() {
  const label = text.theme.label(text.theme[choice.value]);
  return (
    <button type="button" class="theme" onClick={nextTheme} aria-label={label} title={label}>
      <Icon path={THEME_ICON} />
    </button>
  );
}
