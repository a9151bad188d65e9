# bash completion of Silhouette's programs, from what their --help says.
_silhouette() {
  local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}
  local -a command=("${COMP_WORDS[0]}")
  local i subcommands help
  for ((i = 1; i < COMP_CWORD; ++i)); do
    subcommands=" $("${command[@]}" --help 2>/dev/null | _silhouette_subcommands | tr '\n' ' ')"
    [[ $subcommands == *" ${COMP_WORDS[i]} "* ]] || break
    command+=("${COMP_WORDS[i]}")
  done
  help=$("${command[@]}" --help 2>/dev/null)
  local values
  values=$(sed -n -E "s/^ +(-[a-z],)?$previous [A-Z]+:\{([^}]*)\}.*/\2/p" <<<"$help" | tr ',' '\n')
  if [[ -n $values ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$values" -- "$word")
  elif [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(grep -o -E '^ +(-[a-z],)?--[a-z0-9-]+' <<<"$help" | grep -o -E -- '--.*')" \
      -- "$word")
  else
    mapfile -t COMPREPLY < <(compgen -W "$(_silhouette_subcommands <<<"$help")" -- "$word")
    [[ ${#COMPREPLY[@]} -gt 0 ]] || mapfile -t COMPREPLY < <(compgen -f -- "$word")
  fi
}

# The subcommands that a help text on stdin lists, a line each.
_silhouette_subcommands() {
  sed -n -E '/^Subcommands:/,/^$/s/^  ([a-z0-9-]+) .*/\1/p'
}

complete -o filenames -F _silhouette silhouette silhouette-calibrate silhouette-capture silhouette-db \
  silhouette-experiments silhouette-record silhouette-server silhouette-sim
