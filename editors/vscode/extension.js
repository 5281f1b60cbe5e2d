// The client of `rtshcua lsp`, and tasks that run `rtshcua lint` and `rtshcua test` on a workspace.
//
// Nothing of a workspace is run before its owner is trusted: the path of the program is a setting, and a setting may come
// from the workspace. Until then VS Code gives colours and snippets, which run nothing.

"use strict";

const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

const LANGUAGE = "rtshcua";
const TASKS = { lint: "check and lint all sources", test: "run the tests of all sources" };

/** @type {LanguageClient | undefined} */
let client;
/** starting and stopping take turns */
let turn = Promise.resolve();

function settings() {
  const all = vscode.workspace.getConfiguration(LANGUAGE);
  return { command: all.get("path", "rtshcua"), args: all.get("arguments", ["lsp"]) };
}

/** Whether the files are on this machine, and their owner is trusted. */
function mayRun() {
  const folders = vscode.workspace.workspaceFolders ?? [];
  const here = folders.length === 0 || folders.some((folder) => folder.uri.scheme === "file");
  return vscode.workspace.isTrusted && here;
}

async function start() {
  if (client !== undefined || !mayRun()) {
    return;
  }
  const { command, args } = settings();
  const started = new LanguageClient(
    LANGUAGE,
    "rtshcua",
    { command, args },
    {
      documentSelector: [{ scheme: "file", language: LANGUAGE }],
      synchronize: {
        fileEvents: vscode.workspace.createFileSystemWatcher("**/{*.rts,rtshcua.toml,pyproject.toml,*.geojson}"),
      },
    },
  );
  client = started;
  try {
    await started.start();
  } catch (error) {
    client = undefined;
    const choice = await vscode.window.showErrorMessage(
      `rtshcua: the language server \`${command}\` does not start: ${error.message}. ` +
        'Install the extra `editor` of rtshcua, or say where it is.',
      "Open Settings",
    );
    if (choice !== undefined) {
      await vscode.commands.executeCommand("workbench.action.openSettings", "rtshcua.path");
    }
  }
}

async function stop() {
  const stopped = client;
  client = undefined;
  await stopped?.dispose();
}

/** @param {() => Promise<void>} step */
function next(step) {
  turn = turn.then(step, step);
  return turn;
}

/** @param {keyof typeof TASKS} command @param {vscode.TaskDefinition} definition */
function task(command, definition) {
  const run = new vscode.ProcessExecution(settings().command, [command, "."]);
  const made = new vscode.Task(definition, vscode.TaskScope.Workspace, command, LANGUAGE, run, "$rtshcua");
  made.detail = TASKS[command];
  if (command === "test") {
    made.group = vscode.TaskGroup.Test;
  }
  return made;
}

const tasks = {
  provideTasks: () =>
    mayRun() ? Object.keys(TASKS).map((command) => task(command, { type: LANGUAGE, command })) : [],
  resolveTask: (given) =>
    mayRun() && Object.hasOwn(TASKS, given.definition.command)
      ? task(given.definition.command, given.definition)
      : undefined,
};

/** @param {vscode.ExtensionContext} context */
function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand("rtshcua.restart", () => next(stop).then(() => next(start))),
    vscode.tasks.registerTaskProvider(LANGUAGE, tasks),
    vscode.workspace.onDidGrantWorkspaceTrust(() => next(start)),
    vscode.workspace.onDidChangeConfiguration((change) => {
      if (change.affectsConfiguration("rtshcua.path") || change.affectsConfiguration("rtshcua.arguments")) {
        void next(stop).then(() => next(start));
      }
    }),
  );
  return next(start);
}

function deactivate() {
  return next(stop);
}

module.exports = { activate, deactivate };
