/** Results of remote methods that the page repeats while it is shown. */

import { signal, type ReadonlySignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { Connection } from "./connection.ts";

export interface Resource<T> {
  value: ReadonlySignal<T | null>;
  error: ReadonlySignal<Error | null>;
  reload: () => Promise<void>;
}

/**
 * Call a method now, after each reconnection, and every `interval` ms while the page is visible.
 * An interval of 0 calls it once per run of the loop.
 */
export function useResource<T>(
  connection: Connection,
  method: string,
  params: object = {},
  interval = 0,
): Resource<T> {
  const key = JSON.stringify(params);
  const resource = useMemo(() => makeResource<T>(connection, method, params), [method, key]);
  const run = connection.hello.value?.run;
  const open = connection.state.value === "open";
  useEffect(() => {
    if (!open) return;
    return repeat(resource.reload, interval);
  }, [resource, run, open, interval]);
  return resource;
}

function makeResource<T>(connection: Connection, method: string, params: object): Resource<T> {
  const value = signal<T | null>(null);
  const error = signal<Error | null>(null);
  const reload = async () => {
    try {
      value.value = await connection.call<T>(method, params);
      error.value = null;
    } catch (problem) {
      error.value = problem instanceof Error ? problem : new Error(String(problem));
    }
  };
  return { value, error, reload };
}

/** Call `action` now and every `interval` ms, never twice at a time. Return a function that ends it. */
function repeat(action: () => Promise<void>, interval: number): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let ended = false;
  const step = async () => {
    if (!document.hidden) await action();
    if (!ended && interval > 0) timer = setTimeout(() => void step(), interval);
  };
  void step();
  return () => {
    ended = true;
    clearTimeout(timer);
  };
}
