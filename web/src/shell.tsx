/** Frame of the page: header, navigation, messages, and the chosen view. */

import { useEffect } from "preact/hooks";
import type { Connection } from "./connection.ts";
import { Header } from "./header.tsx";
import { Login } from "./login.tsx";
import { dismiss, notices, notify } from "./notices.ts";
import { Icon } from "./parts/common.tsx";
import { cancelQuestion, ConfirmDialog } from "./parts/confirm.tsx";
import { address, route } from "./route.ts";
import { text } from "./strings.ts";
import { views } from "./views.ts";

export function Shell({ connection }: { connection: Connection }) {
  useEffect(
    () =>
      connection.on("error", ({ message, hint }) => notify(message, { hint, kind: "bad" })),
    [connection],
  );
  useEffect(
    () => connection.state.subscribe((state) => state !== "open" && cancelQuestion()),
    [connection],
  );
  useEffect(cancelQuestion, [connection.hello.value?.run]);
  if (connection.state.value === "login") return <Login connection={connection} />;
  const view = views.find(({ key }) => key === route.value[0]) ?? views[0];
  if (view === undefined) return null;
  const Shown = view.component;
  return (
    <div class="shell">
      <Header connection={connection} />
      <Rail shown={view.key} />
      <main class={isLive(connection) ? "main" : "main stale"} id="main" aria-label={view.label}>
        <Banner connection={connection} />
        <Shown connection={connection} />
      </main>
      <Notices />
      <ConfirmDialog />
    </div>
  );
}

function isLive(connection: Connection): boolean {
  const { state, fresh, running } = connection;
  return state.value === "open" && fresh.value && running.value;
}

function Rail({ shown }: { shown: string }) {
  return (
    <div class="rail">
      <nav aria-label={text.navigation.label}>
        {views.map(({ key, label, icon }) => (
          <a key={key} href={address(key)} aria-current={key === shown ? "page" : undefined}>
            <Icon path={icon} />
            {label}
          </a>
        ))}
      </nav>
    </div>
  );
}

/** Why the values on the page are old, if they are. */
function Banner({ connection }: { connection: Connection }) {
  const state = connection.state.value;
  if (state === "gone") {
    return (
      <div class="banner" role="alert">
        <strong>{text.banner.gone}</strong> <span>{connection.reason.value}</span>
      </div>
    );
  }
  if (state === "lost") {
    return (
      <div class="banner bad" role="alert">
        <strong>{text.banner.lost}</strong> <span>{text.banner.lostHint}</span>
      </div>
    );
  }
  if (state === "open" && !connection.fresh.value) {
    return (
      <div class="banner bad" role="alert">
        <strong>{text.banner.silent}</strong> <span>{text.banner.silentHint}</span>
      </div>
    );
  }
  if (state === "open" && !connection.running.value) {
    return (
      <div class="banner bad" role="alert">
        <strong>{text.banner.stalled}</strong> <span>{text.banner.stalledHint}</span>
      </div>
    );
  }
  return null;
}

function Notices() {
  return (
    <div class="notices" role="log" aria-live="polite" aria-label={text.common.messages}>
      {notices.value.map(({ id, kind, message, hint }) => (
        <div key={id} class={`notice ${kind}`}>
          <div class="grow">
            <div>{message}</div>
            {hint !== "" && <div class="muted small">{hint}</div>}
          </div>
          <button
            type="button"
            class="button quiet small"
            aria-label={text.common.dismiss}
            onClick={() => dismiss(id)}
          >
            ✕
          </button>
        </div>
      ))}
    </div>
  );
}
