/** Panel with the robot in 3D. The code of three.js is loaded only when the panel is open. */

import { useEffect, useRef, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { isPhone } from "../media.ts";
import { Panel } from "../parts/common.tsx";
import { KIND_POSES, type ErrorBody } from "../protocol.ts";
import { notifyError } from "../notices.ts";
import type { Greeting } from "../remote.ts";
import { useResource } from "../resource.ts";
import { text } from "../strings.ts";
import { decodePoses, decodeScene, type SceneData } from "./decode.ts";
import type { Push, Viewer } from "./viewer.ts";

const PUSH_SECONDS = 0.2; // the force ends by itself when the pushes end

type Loading = { scene: SceneData } | { reason: string } | null; // null: there is no model

/** Show the robot of the share, or why this is not possible; nothing if the server has no model. */
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
  if ("reason" in loading) return <Missing reason={loading.reason} />;
  return <CollapsiblePanel connection={connection} scene={loading.scene} />;
}

/** Why the server cannot show its model. */
function Missing({ reason }: { reason: string }) {
  return (
    <Panel title={text.scene.title} class="scene-panel">
      <p class="empty" role="status">{text.scene.missing(reason)}</p>
    </Panel>
  );
}

interface RobotProps {
  connection: Connection;
  scene: SceneData;
}

/** Panel that is closed on a phone until it is opened. */
function CollapsiblePanel(props: RobotProps) {
  const [open, setOpen] = useState(!isPhone.peek());
  if (open) return <RobotView {...props} close={() => setOpen(false)} />;
  return (
    <Panel
      title={text.scene.title}
      actions={<ToggleButton label={text.scene.show} open={false} onClick={() => setOpen(true)} />}
      class="scene-panel closed"
    />
  );
}

function ToggleButton(props: { label: string; open: boolean; onClick: () => void }) {
  return (
    <button type="button" class="button small" aria-expanded={props.open} onClick={props.onClick}>
      {props.label}
    </button>
  );
}

async function load(signal: AbortSignal): Promise<Loading> {
  const reply = await fetch("/scene", { signal });
  if (reply.status === 204 || reply.status === 401) return null;
  if (!reply.ok) return { reason: ((await reply.json()) as { error: ErrorBody }).error.message };
  return { scene: decodeScene(await reply.arrayBuffer()) };
}

function RobotView({ connection, scene, close }: RobotProps & { close: () => void }) {
  const place = useRef<HTMLDivElement>(null);
  const viewer = useRef<Viewer | null>(null);
  const [ghost, setGhost] = useState(true);
  const [failure, setFailure] = useState("");
  const program = useResource<Greeting>(connection, "hello").value.value;
  const canPush = program?.virtual === true && connection.role.value === "operator";
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
      <ToggleButton label={text.scene.hide} open onClick={close} />
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
      if (!ended) ends.push(...run(connection, scene, new Viewer(element, scene), options));
    })
    .catch((error: Error) => options.failed(error.message));
  return () => {
    ended = true;
    for (const end of ends) end();
  };
}

function run(
  connection: Connection, scene: SceneData, viewer: Viewer, options: Attachment,
): (() => void)[] {
  const request = () => void connection.send({ op: "poses", on: true });
  options.created(viewer);
  if (options.canPush) viewer.onPush = pushing(connection, scene);
  request();
  return [
    connection.onBinary(KIND_POSES, (buffer) => viewer.show(decodePoses(buffer))),
    connection.on("hello", request),
    () => void connection.send({ op: "poses", on: false }),
    () => options.created(null),
    () => viewer.dispose(),
  ];
}

/** Push a body for a short time. A repeated push replaces it. */
function pushing(connection: Connection, scene: SceneData): (push: Push) => void {
  let busy = false;
  return ({ body, point, force }) => {
    if (busy) return;
    busy = true;
    connection
      .call("virtual_push", { body: scene.bodies[body], point, force, seconds: PUSH_SECONDS })
      .catch(notifyError)
      .finally(() => (busy = false));
  };
}
