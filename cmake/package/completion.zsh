#compdef silhouette silhouette-calibrate silhouette-capture silhouette-db silhouette-experiments silhouette-record silhouette-server silhouette-sim
# zsh completion of Silhouette's programs, from what their --help says.

# The subcommands that a help text on stdin lists, as "name:summary", a line each.
_silhouette_subcommands() {
  sed -n -E '/^Subcommands:/,/^$/s/^  ([a-z0-9-]+) +(.*)/\1:\2/p'
}

_silhouette() {
  local help word
  local -a command subcommands options values
  command=($words[1])
  for word in ${words[2,CURRENT-1]}; do
    subcommands=(${(f)"$($command --help 2>/dev/null | _silhouette_subcommands)"})
    (( ${subcommands[(I)$word:*]} )) || break
    command+=($word)
  done
  help=$($command --help 2>/dev/null)
  values=(${(s:,:)"$(sed -n -E "s/^ +(-[a-z],)?${words[CURRENT-1]} [A-Z]+:\{([^}]*)\}.*/\2/p" <<<$help)"})
  options=(${(f)"$(grep -o -E -- '^ +(-[a-z],)?--[a-z0-9-]+' <<<$help | grep -o -E -- '--.*')"})
  subcommands=(${(f)"$(_silhouette_subcommands <<<$help)"})
  if (( $#values )); then
    compadd -a values
  elif [[ $words[CURRENT] == -* ]]; then
    compadd -a options
  elif (( $#subcommands )); then
    _describe command subcommands
  else
    _files
  fi
}

_silhouette "$@"
