/** Recordings: list, open, and move through the time. */

import { useEffect, useState } from "preact/hooks";
import { count, duration, timeOfDay } from "../logic/format.ts";
import { Panel } from "../parts/common.tsx";
import { address, route } from "../route.ts";
import { Chart } from "../scope/chart.tsx";
import { withChart } from "../scope/layout.ts";
import { Picker } from "../scope/picker.tsx";
import { useFrames, useTheme } from "../scope/scope.tsx";
import { Measurements } from "../scope/table.tsx";
import { text } from "../strings.ts";
import { listRecordings, openRecording, type RecordingFile } from "./client.ts";
import { RecordingModel } from "./model.ts";

export function Recordings() {
  const name = route.value[1];
  return name ? <Opened key={name} name={name} /> : <List />;
}

function List() {
  const [files, setFiles] = useState<RecordingFile[] | null>(null);
  const [failure, setFailure] = useState("");
  useEffect(() => {
    listRecordings().then(setFiles, (error: Error) => setFailure(error.message));
  }, []);
  return (
    <Panel title={text.recordings.title}>
      {failure !== "" && <p class="empty" role="alert">{failure}</p>}
      {files?.length === 0 && <p class="empty">{text.recordings.none}</p>}
      {files !== null && files.length > 0 && (
        <div class="scroll-x">
          <table>
            <thead>
              <tr>{Object.values(text.recordings.columns).map((column) => <th key={column} scope="col">{column}</th>)}</tr>
            </thead>
            <tbody>{files.map((file) => <FileRow key={file.name} file={file} />)}</tbody>
          </table>
        </div>
      )}
    </Panel>
  );
}

function FileRow({ file }: { file: RecordingFile }) {
  return (
    <tr>
      <td><a href={address("recordings", file.name)}>{file.name}</a></td>
      <td>{new Date(file.modified * 1000).toLocaleString()}</td>
      <td>{(file.size / 1e6).toFixed(1)} MB</td>
    </tr>
  );
}

function Opened({ name }: { name: string }) {
  const [model, setModel] = useState<RecordingModel | null>(null);
  const [failure, setFailure] = useState("");
  useEffect(() => {
    let created: RecordingModel | null = null;
    let ended = false;
    openRecording(name).then(
      (info) => !ended && setModel((created = new RecordingModel(name, info))),
      (error: Error) => setFailure(error.message),
    );
    return () => {
      ended = true;
      created?.close();
    };
  }, [name]);
  return (
    <div class="recording">
      <p><a href={address("recordings")}>{text.recordings.back}</a></p>
      {failure !== "" && <p class="panel empty" role="alert">{failure}</p>}
      {model !== null && <Recording model={model} />}
    </div>
  );
}

function Recording({ model }: { model: RecordingModel }) {
  const theme = useTheme();
  useFrames(model);
  const { info } = model;
  const layout = model.layout.value!;
  return (
    <div class="scope">
      <h1>{model.name}</h1>
      <div class="scope-toolbar">
        <strong>{model.name}</strong>
        <span>{text.recordings.about(timeOfDay(info.started), duration(info.duration), info.layout.axes.length)}</span>
        {!info.ended && <span class="chip warn">{text.recordings.unfinished}</span>}
        {info.lost > 0 && <span class="chip warn">{text.recordings.lost(count(info.lost))}</span>}
        <button type="button" class="button small" onClick={() => model.live()}>{text.recordings.all}</button>
        <button type="button" class="button small" onClick={() => model.toggleCursors()}
          aria-pressed={model.cursors.value[0] !== null}>{text.scope.cursors}</button>
        <button type="button" class="button small" onClick={() => model.change(withChart(layout))}>{text.scope.addChart}</button>
      </div>
      <Scrubber model={model} />
      <div class="scope-side">
        <Picker model={model} />
        <Events model={model} />
      </div>
      <div class="scope-charts">
        {layout.charts.map((chart, index) => (
          <Chart key={chart.id} model={model} chart={chart} number={index + 1} theme={theme} />
        ))}
        <p class="scope-time">{text.recordings.time}</p>
      </div>
      <Measurements model={model} />
    </div>
  );
}

/** Slider that moves the visible range through the recording. */
function Scrubber({ model }: { model: RecordingModel }) {
  const { start, end } = model.shown.value;
  const length = end - start;
  const last = Math.max(0, model.info.duration - length);
  const progress = model.progress.value;
  return (
    <div class="scope-trigger recording-scrub">
      <input type="range" min="0" max={last} step="any" value={Math.min(Math.max(start, 0), last)} disabled={last === 0}
        aria-label={text.recordings.scrub} aria-valuetext={`${start.toFixed(3)} s`}
        onInput={(event) => model.showFrom(event.currentTarget.valueAsNumber, length)} />
      <output>{text.recordings.range(start.toFixed(3), end.toFixed(3))}</output>
      <span role="status">
        {progress !== null && text.recordings.reading(Math.round(progress * 100))}
        {model.failure.value !== "" && <span class="bad-text">{model.failure.value}</span>}
      </span>
    </div>
  );
}

function Events({ model }: { model: RecordingModel }) {
  const { events } = model.info;
  if (events.length === 0) return null;
  const length = Math.min(1, model.longest);
  return (
    <>
      <h2>{text.recordings.events}</h2>
      <ul class="recording-events">
        {events.map((event, index) => (
          <li key={index}>
            <button type="button" class="button quiet small" onClick={() => model.showFrom(event.time - length / 2, length)}>
              {event.time.toFixed(3)} s
            </button>
            <span>{event.message}</span>
          </li>
        ))}
      </ul>
    </>
  );
}
