-- Neovim changes a versioned message and gives it its next version, by what `msggen lsp` offers alone.
-- The environment names the tree (TREE) and the Python of the server (PYTHON).

local function say(...) io.stdout:write(table.concat({ ... }, " ") .. "\n") end

local function wait(what, reached)
  if not vim.wait(120000, reached, 20) then
    say("no answer:", what)
    vim.cmd("cq")
  end
end

local tree = os.getenv("TREE")
vim.cmd("edit " .. tree .. "/msg/versioned/VehicleStatus.msg")
local command = { os.getenv("PYTHON"), "-m", "msggen", "lsp" }
local id = vim.lsp.start_client({ name = "msggen", cmd = command, root_dir = tree })
vim.lsp.buf_attach_client(0, id)
wait("start", function() return vim.lsp.get_client_by_id(id).initialized end)

local function ask(method, parameters)
  local answers = vim.lsp.buf_request_sync(0, method, parameters, 120000)
  return answers[id].result
end

local function code(problem) return problem.code or problem.user_data.lsp.code end

local function problem(wanted)
  for _, each in ipairs(vim.diagnostic.get(0)) do
    if code(each) == wanted then return each end
  end
end

vim.fn.search("^uint8 nav_state ")
vim.cmd("normal! w")
local shown = ask("textDocument/hover", vim.lsp.util.make_position_params())
say("hover:", (shown.contents.value:gsub("\n.*", "")))

vim.api.nvim_buf_set_lines(0, -1, -1, false, { "uint8 added # Added." })
wait("breaking", function() return problem("VERSION_NOT_RAISED") and problem("FIELD_ADDED") end)
for _, each in ipairs(vim.diagnostic.get(0)) do
  say("problem:", each.lnum + 1, code(each), each.message)
end

local at = { line = problem("VERSION_NOT_RAISED").lnum, character = 0 }
local actions = ask("textDocument/codeAction", {
  textDocument = vim.lsp.util.make_text_document_params(),
  range = { start = at, ["end"] = at },
  context = { diagnostics = {} },
})
for _, action in ipairs(actions) do
  say("action:", action.title)
  if action.title == "msggen bump VehicleStatus" then
    vim.lsp.util.apply_workspace_edit(ask("codeAction/resolve", action).edit, "utf-16")
  end
end
vim.cmd("silent wall")
wait("the next version", function() return not problem("VERSION_NOT_RAISED") end)
say("line:", vim.fn.getline(vim.fn.search("MESSAGE_VERSION", "w")))
vim.lsp.stop_client(id)
vim.cmd("qa!")
