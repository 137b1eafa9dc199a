/** Views whose code is loaded when they are shown first. */

import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import type { Connection } from "../connection.ts";
import { text } from "../strings.ts";

type View = ComponentType<{ connection: Connection }>;

/** Return a view that loads its code itself. After a failure, a button repeats the load. */
export function lazy(load: () => Promise<View>): View {
  const loaded = signal<View | null>(null);
  const failure = signal("");
  let loading: Promise<void> | null = null;
  const start = () => {
    failure.value = "";
    loading = load()
      .then((view) => void (loaded.value = view))
      .catch((error: Error) => {
        loading = null;
        failure.value = error.message;
      });
  };
  return ({ connection }) => {
    const Shown = loaded.value;
    if (Shown !== null) return <Shown connection={connection} />;
    if (failure.value !== "") return <LoadFailure reason={failure.value} retry={start} />;
    if (loading === null) start();
    return <p class="empty" role="status">{text.common.loading}</p>;
  };
}

function LoadFailure({ reason, retry }: { reason: string; retry: () => void }) {
  return (
    <div class="empty" role="alert">
      <p>{text.common.notLoaded(reason)}</p>
      <button type="button" class="button" onClick={retry}>{text.common.retry}</button>
    </div>
  );
}
