/** Panel with the robot in 3D. The code of three.js is loaded only when the panel is open. */

import "./scene.css";
import { useEffect, useRef, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { Panel } from "../parts/common.tsx";
import { KIND_POSES } from "../protocol.ts";
import { text } from "../strings.ts";
import { decodePoses, decodeScene, type SceneData } from "./decode.ts";
import type { Push, Viewer } from "./viewer.ts";

const PUSH_INTERVAL = 33; // [ms]
const RATE = 30; // [Hz]

type Loading = { scene: SceneData } | { reason: string } | null;

/** Show the robot of the share; nothing if the server has no model. */
export function ScenePanel({ connection }: { connection: Connection }) {
  const [loading, setLoading] = useState<Loading>(null);
  const run = connection.hello.value?.run;
  useEffect(() => {
    const abort = new AbortController();
    load(abort.signal).then(setLoading, (error: Error) => {
      if (!abort.signal.aborted) setLoading({ reason: error.message });
    });
    return () => abort.abort();
  }, [run]);
  if (loading === null) return null;
  if ("reason" in loading) return null;
  return <RobotView connection={connection} scene={loading.scene} />;
}

async function load(signal: AbortSignal): Promise<Loading> {
  const reply = await fetch("/scene", { signal });
  if (reply.status !== 200) return { reason: `HTTP ${reply.status}` };
  return { scene: decodeScene(await reply.arrayBuffer()) };
}

function RobotView({ connection, scene }: { connection: Connection; scene: SceneData }) {
  const place = useRef<HTMLDivElement>(null);
  const viewer = useRef<Viewer | null>(null);
  const [ghost, setGhost] = useState(true);
  const [failure, setFailure] = useState("");
  const canPush = scene.push === true && connection.role.value === "operator";
  useEffect(() => {
    const created = (view: Viewer | null) => (viewer.current = view);
    return attach(connection, scene, place.current!, { canPush, created, failed: setFailure });
  }, [connection, scene, canPush]);
  useEffect(() => viewer.current?.showGhost(ghost), [ghost]);
  const actions = (
    <>
      <label class="row">
        <input type="checkbox" checked={ghost} onChange={(event) => setGhost(event.currentTarget.checked)} />
        {text.scene.ghost}
      </label>
      <button type="button" class="button small" onClick={() => viewer.current?.resetCamera()}>{text.scene.reset}</button>
    </>
  );
  return (
    <Panel title={text.scene.title} actions={actions} class="scene-panel">
      <div ref={place} class="scene-view" role="img" aria-label={text.scene.label(scene.bodies.length)} />
      {failure !== "" && <p class="empty" role="status">{text.scene.failed(failure)}</p>}
      <p class="small muted scene-note">{canPush ? text.scene.pushHint : text.scene.hint}</p>
    </Panel>
  );
}

interface Attachment {
  canPush: boolean;
  created: (viewer: Viewer | null) => void;
  failed: (reason: string) => void;
}

/** Load the viewer and feed it with poses. Return a function that ends it. */
function attach(
  connection: Connection, scene: SceneData, element: HTMLElement, options: Attachment,
): () => void {
  const ends: (() => void)[] = [];
  let ended = false;
  import("./viewer.ts")
    .then(({ Viewer }) => {
      if (!ended) ends.push(...run(connection, new Viewer(element, scene), options));
    })
    .catch((error: Error) => options.failed(error.message));
  return () => {
    ended = true;
    for (const end of ends) end();
  };
}

function run(connection: Connection, viewer: Viewer, options: Attachment): (() => void)[] {
  const request = () => void connection.send({ op: "poses", rate: RATE });
  options.created(viewer);
  if (options.canPush) {
    viewer.onPush = throttled((push) => void connection.send({ op: "push", ...push }));
  }
  request();
  return [
    connection.onBinary(KIND_POSES, (buffer) => viewer.show(decodePoses(buffer))),
    connection.on("hello", request),
    () => void connection.send({ op: "poses", rate: 0 }),
    () => options.created(null),
    () => viewer.dispose(),
  ];
}

/** Pass at most one push in each interval; the end of a push always. */
function throttled(send: (push: Push) => void): (push: Push) => void {
  let last = 0;
  return (push) => {
    const ends = push.force.every((each) => each === 0);
    if (!ends && performance.now() - last < PUSH_INTERVAL) return;
    last = performance.now();
    send(push);
  };
}
