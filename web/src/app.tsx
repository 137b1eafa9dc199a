/** Entry point of the operator's page. */

import "./app.css";
import { render } from "preact";
import { Connection } from "./connection.ts";
import { views } from "./views.ts";

const connection = new Connection();
const root = document.getElementById("app");
const First = views[0]?.component;
if (root !== null && First !== undefined) render(<First connection={connection} />, root);
void connection.start();
